//! A stand-in for a learned car prior: two boxes whose cabin sits towards the rear, so that front (−Z) and rear
//! differ, sampled by farthest points like the real one.

use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::{DepthMap, Mask, RgbImage};
use crate::prior::ShapePrior;
use crate::sequence::{Frame, Sequence};
use crate::visibility::visible_points;

/// S = 1: the style lengthens the nose.
pub(super) struct BoxCar {
    points: Vec<Vector3<f64>>,
}

impl BoxCar {
    pub fn new(count: usize) -> Self {
        let body = (Vector3::new(-0.18, -0.13, -0.45), Vector3::new(0.18, 0.02, 0.45));
        let cabin = (Vector3::new(-0.15, 0.02, -0.08), Vector3::new(0.15, 0.14, 0.42));
        let mut candidates: Vec<Vector3<f64>> = Vec::new();
        for (low, high) in [body, cabin] {
            candidates.extend(box_surface(&low, &high, 0.012));
        }
        Self {
            points: farthest_first(&candidates, count),
        }
    }
}

impl ShapePrior for BoxCar {
    fn style_len(&self) -> usize {
        1
    }

    fn point_count(&self) -> usize {
        self.points.len()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        for (out, x) in points.chunks_exact_mut(3).zip(&self.points) {
            out.copy_from_slice(&[x.x, x.y, x.z + 0.05 * style[0] * x.z.min(0.0)]);
        }
    }

    fn jacobian(&self, _: &[f64], jacobian: &mut [f64]) {
        for (out, x) in jacobian.chunks_exact_mut(3).zip(&self.points) {
            out.copy_from_slice(&[0.0, 0.0, 0.05 * x.z.min(0.0)]);
        }
    }
}

fn box_surface(low: &Vector3<f64>, high: &Vector3<f64>, step: f64) -> Vec<Vector3<f64>> {
    let counts = (high - low).map(|side| (side / step).ceil() as usize);
    let mut points = Vec::new();
    for i in 0..=counts.x {
        for j in 0..=counts.y {
            for k in 0..=counts.z {
                let on_face = i % counts.x == 0 || j % counts.y == 0 || k % counts.z == 0;
                if on_face {
                    let share = Vector3::new(i as f64, j as f64, k as f64).component_div(&counts.cast());
                    points.push(low + (high - low).component_mul(&share));
                }
            }
        }
    }
    points
}

fn farthest_first(candidates: &[Vector3<f64>], count: usize) -> Vec<Vector3<f64>> {
    let mut distances = vec![f64::INFINITY; candidates.len()];
    let mut next = 0;
    let mut chosen = Vec::with_capacity(count);
    for _ in 0..count.min(candidates.len()) {
        chosen.push(candidates[next]);
        for (distance, candidate) in distances.iter_mut().zip(candidates) {
            *distance = distance.min((candidate - candidates[next]).norm_squared());
        }
        next = (0..candidates.len())
            .max_by(|&a, &b| distances[a].total_cmp(&distances[b]))
            .unwrap();
    }
    chosen
}

pub(super) const CAMERA: Pinhole = Pinhole {
    fx: 300.0,
    fy: 300.0,
    cx: 188.0,
    cy: 125.0,
};
pub(super) const SIZE: (usize, usize) = (376, 250);

/// The car as the cameras see it; the off-the-shelf poses are the true ones in a frame scaled by 1 / `alpha`, moved
/// and turned, with depth in the same units.
pub(super) fn sequence(camera_from_object: &[Pose], alpha: f64) -> Sequence {
    let car = BoxCar::new(6000);
    let mut points = vec![0.0; 3 * car.point_count()];
    car.points(&[0.0], &mut points);
    let input_from_object = Pose::from_twist(&nalgebra::Vector6::new(0.3, 1.1, -0.4, 0.5, -2.0, 1.0));
    let frames = camera_from_object.iter().enumerate().map(|(index, pose)| {
        let seen = visible_points(&points, &CAMERA, pose, SIZE, None);
        let mut depth = DepthMap::filled(SIZE.0, SIZE.1, 0.0);
        for point in &seen.points {
            let pixel = (point.pixel.0 as usize, point.pixel.1 as usize);
            depth[pixel] = (1.0 / point.inverse_depth / alpha) as f32;
        }
        let scaled = Pose {
            translation: pose.translation / alpha,
            ..*pose
        };
        Frame {
            name: format!("frame-{index}"),
            image: RgbImage::filled(SIZE.0, SIZE.1, [0.0; 3]),
            mask: solid(&car.points, pose),
            camera: CAMERA,
            timestamp_s: None,
            camera_from_input: Some(scaled.after(&input_from_object.inverse())),
            depth: Some(depth),
        }
    });
    Sequence {
        name: "box-car".into(),
        frames: frames.collect(),
        truth: None,
    }
}

/// A mask from splats of one sampling interval.
fn solid(points: &[Vector3<f64>], camera_from_object: &Pose) -> Mask {
    let mut mask = Mask::filled(SIZE.0, SIZE.1, false);
    for point in points {
        let in_camera = camera_from_object.transform(point);
        let Some(pixel) = CAMERA.project(&in_camera) else {
            continue;
        };
        let reach = 0.008 * CAMERA.fx / in_camera.z;
        for dy in -2..=2 {
            for dx in -2..=2 {
                let at = (
                    pixel.x + f64::from(dx) / 2.0 * reach,
                    pixel.y + f64::from(dy) / 2.0 * reach,
                );
                if let Some(pixel) = mask.pixel_at(at.0, at.1) {
                    mask[pixel] = true;
                }
            }
        }
    }
    mask
}
