//! The shape's points as templates need them: projected by the hundred million, to a fraction of a cell.

use crate::geometry::{Matrix3, Pose, Vector2, Vector3};

/// Points that are projected at once: few enough for the results to stay in the nearest cache.
const BLOCK: usize = 256;

/// Points in the object frame, coordinate by coordinate and in single precision, so that the compiler projects
/// several with one instruction.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

impl Cloud {
    /// Calls `found` with the image points (first coordinates, second coordinates) block by block, in the points'
    /// order. `image_from_camera` is the camera matrix. What does not lie in front of the camera is not a number.
    pub fn project(
        &self,
        image_from_camera: &Matrix3<f64>,
        camera_from_object: &Pose,
        mut found: impl FnMut(&[f32], &[f32]),
    ) {
        let turned = (image_from_camera * camera_from_object.rotation.matrix()).cast::<f32>();
        let moved = (image_from_camera * camera_from_object.translation).cast::<f32>();
        let row = |axis: usize| {
            [
                turned[(axis, 0)],
                turned[(axis, 1)],
                turned[(axis, 2)],
                moved[axis],
            ]
        };
        let [first_row, second_row, depth_row] = [row(0), row(1), row(2)];
        let (mut first, mut second) = ([0.0; BLOCK], [0.0; BLOCK]);
        let blocks = self
            .x
            .chunks(BLOCK)
            .zip(self.y.chunks(BLOCK))
            .zip(self.z.chunks(BLOCK));
        for ((xs, ys), zs) in blocks {
            let count = xs.len();
            let images = first.iter_mut().zip(&mut second);
            for (((u, v), &x), (&y, &z)) in images.zip(xs).zip(ys.iter().zip(zs)) {
                let along = |row: &[f32; 4]| row[0] * x + row[1] * y + (row[2] * z + row[3]);
                let depth = along(&depth_row);
                let scale = if depth > 0.0 { 1.0 / depth } else { f32::NAN };
                *u = along(&first_row) * scale;
                *v = along(&second_row) * scale;
            }
            found(&first[..count], &second[..count]);
        }
    }

    /// Lowest and highest corner of the image points' bounding box; `None` where nothing is in front of the camera.
    pub fn bounds(
        &self,
        image_from_camera: &Matrix3<f64>,
        camera_from_object: &Pose,
    ) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let mut low = [f32::INFINITY; 2];
        let mut high = [f32::NEG_INFINITY; 2];
        self.project(image_from_camera, camera_from_object, |first, second| {
            for (axis, values) in [first, second].into_iter().enumerate() {
                // Neither takes a NaN.
                low[axis] = values
                    .iter()
                    .fold(low[axis], |low, &x| if x < low { x } else { low });
                high[axis] = values
                    .iter()
                    .fold(high[axis], |high, &x| if x > high { x } else { high });
            }
        });
        let corner = |corner: [f32; 2]| Vector2::from(corner).cast::<f64>();
        (low[0] <= high[0]).then(|| (corner(low), corner(high)))
    }
}

impl FromIterator<Vector3<f64>> for Cloud {
    fn from_iter<I: IntoIterator<Item = Vector3<f64>>>(points: I) -> Self {
        let (mut x, mut y, mut z) = (Vec::new(), Vec::new(), Vec::new());
        for point in points {
            x.push(point.x as f32);
            y.push(point.y as f32);
            z.push(point.z as f32);
        }
        Self { x, y, z }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pinhole, Rotation3};

    #[test]
    fn image_points_and_bounds_are_the_camera_s() {
        let camera = Pinhole {
            fx: 300.0,
            fy: 310.0,
            cx: 100.0,
            cy: 80.0,
        };
        let matrix = Matrix3::new(300.0, 0.0, 100.0, 0.0, 310.0, 80.0, 0.0, 0.0, 1.0);
        let pose = Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.3, -0.8, 0.2)),
            translation: Vector3::new(0.05, -0.02, 1.6),
        };
        // More than two blocks; the last point is behind the camera.
        let mut points: Vec<Vector3<f64>> = (0..600)
            .map(|i| Vector3::new(f64::from(i % 7), f64::from(i % 11), f64::from(i % 13)) / 20.0)
            .collect();
        points.push(pose.inverse().transform(&Vector3::new(0.0, 0.0, -1.0)));
        let cloud: Cloud = points.iter().copied().collect();
        let mut found = Vec::new();
        cloud.project(&matrix, &pose, |u, v| {
            found.extend(u.iter().zip(v).map(|(&u, &v)| Vector2::new(u, v).cast::<f64>()));
        });
        assert_eq!(found.len(), 601);
        assert!(found[600].x.is_nan() && found[600].y.is_nan());
        let (low, high) = cloud.bounds(&matrix, &pose).unwrap();
        for (found, point) in found.iter().zip(&points[..600]) {
            let expected = camera.project(&pose.transform(point)).unwrap();
            assert!((found - expected).norm() < 1e-3, "{found} {expected}");
            assert!(low.inf(found) == low && high.sup(found) == high);
        }
        let behind = Pose {
            translation: Vector3::new(0.0, 0.0, -9.0),
            ..pose
        };
        assert_eq!(cloud.bounds(&matrix, &behind), None);
    }
}
