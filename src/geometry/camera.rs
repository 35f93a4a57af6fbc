//! The perspective camera of Eq. 1 (with the division that the paper leaves out).

use nalgebra::{Matrix3, Vector2, Vector3};

/// Pinhole intrinsics in pixels; the centre of the top-left pixel is (0.5, 0.5).
///
/// ```
/// use spba_ceres::geometry::{Pinhole, Vector3};
///
/// let camera = Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 };
/// let pixel = camera.project(&Vector3::new(0.2, 0.0, 2.0)).unwrap();
/// assert_eq!((pixel.x, pixel.y), (370.0, 240.0));
/// assert!(camera.project(&Vector3::new(0.0, 0.0, -1.0)).is_none()); // behind the camera
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pinhole {
    /// The focal length along x, pixels.
    pub fx: f64,
    /// The focal length along y, pixels.
    pub fy: f64,
    /// The column of the principal point, pixels.
    pub cx: f64,
    /// The row of the principal point, pixels.
    pub cy: f64,
}

impl Pinhole {
    /// The pixel of a point given in the camera frame; `None` unless it lies in front of the camera.
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        let z = point_in_camera.z;
        (z > 0.0).then(|| {
            Vector2::new(
                self.fx * point_in_camera.x / z + self.cx,
                self.fy * point_in_camera.y / z + self.cy,
            )
        })
    }

    /// The point in the camera frame at depth `z` that projects to `pixel`.
    pub fn unproject(&self, pixel: &Vector2<f64>, z: f64) -> Vector3<f64> {
        Vector3::new(
            (pixel.x - self.cx) / self.fx * z,
            (pixel.y - self.cy) / self.fy * z,
            z,
        )
    }

    /// The camera of the same image resized by (`scale_x`, `scale_y`).
    pub fn scaled(&self, scale_x: f64, scale_y: f64) -> Self {
        Self {
            fx: self.fx * scale_x,
            fy: self.fy * scale_y,
            cx: self.cx * scale_x,
            cy: self.cy * scale_y,
        }
    }

    /// The 3 × 3 calibration matrix K.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn unproject_inverts_project(u in -100.0..700.0f64, v in -100.0..500.0f64, z in 0.01..50.0f64) {
            let camera = Pinhole { fx: 500.0, fy: 480.0, cx: 320.5, cy: 241.0 };
            let pixel = Vector2::new(u, v);
            let back = camera.project(&camera.unproject(&pixel, z)).unwrap();
            prop_assert!((back - pixel).norm() < 1e-9);
        }

        #[test]
        fn scaling_the_camera_scales_the_pixel(x in -1.0..1.0f64, y in -1.0..1.0f64, z in 0.5..9.0f64) {
            let camera = Pinhole { fx: 500.0, fy: 480.0, cx: 320.5, cy: 241.0 };
            let point = Vector3::new(x, y, z);
            let full = camera.project(&point).unwrap();
            let half = camera.scaled(0.5, 0.25).project(&point).unwrap();
            prop_assert!((half - Vector2::new(full.x * 0.5, full.y * 0.25)).norm() < 1e-9);
        }
    }

    #[test]
    fn a_point_behind_the_camera_has_no_pixel() {
        let camera = Pinhole {
            fx: 500.0,
            fy: 500.0,
            cx: 320.0,
            cy: 240.0,
        };
        assert!(camera.project(&Vector3::new(0.1, 0.1, -1.0)).is_none());
        assert!(camera.project(&Vector3::new(0.1, 0.1, 0.0)).is_none());
    }
}
