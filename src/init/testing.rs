//! A stand-in for a learned car prior: two boxes whose cabin sits towards the rear, so that front (−Z) and rear
//! differ, sampled by farthest points like the real one.

use crate::geometry::{Pinhole, Pose, Vector2, Vector3};
use crate::image::{Grid, Mask, RgbImage};
use crate::prior::ShapePrior;
use crate::sequence::{Frame, Sequence, SequenceContent};

const BODY: (Vector3<f64>, Vector3<f64>) =
    (Vector3::new(-0.18, -0.13, -0.45), Vector3::new(0.18, 0.02, 0.45));
const CABIN: (Vector3<f64>, Vector3<f64>) =
    (Vector3::new(-0.15, 0.02, -0.08), Vector3::new(0.15, 0.14, 0.42));

/// S = 1: the style lengthens the nose.
pub(super) struct BoxCar {
    points: Vec<Vector3<f64>>,
}

impl BoxCar {
    pub fn new(count: usize) -> Self {
        let mut candidates: Vec<Vector3<f64>> = Vec::new();
        for (low, high) in [BODY, CABIN] {
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

/// The car as the cameras see it, by casting rays at its boxes; the off-the-shelf poses are the true ones in a
/// frame scaled by 1 / `alpha`, moved and turned, with depth in the same units.
pub(super) fn sequence(camera_from_object: &[Pose], alpha: f64) -> Sequence {
    let input_from_object = Pose::from_twist(&nalgebra::Vector6::new(0.3, 1.1, -0.4, 0.5, -2.0, 1.0));
    let frames = camera_from_object.iter().enumerate().map(|(index, pose)| {
        let depth = Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            let pixel = Vector2::new(column as f64 + 0.5, row as f64 + 0.5);
            let ray = pose.rotation.inverse() * CAMERA.unproject(&pixel, 1.0);
            let hits = [BODY, CABIN]
                .into_iter()
                .filter_map(|b| meet(&b, &pose.center(), &ray));
            hits.reduce(f64::min)
        });
        let scaled = Pose {
            translation: pose.translation / alpha,
            ..*pose
        };
        Frame {
            name: format!("frame-{index}"),
            image: RgbImage::filled(SIZE.0, SIZE.1, [0.0; 3]).into(),
            mask: Mask::from_fn(SIZE.0, SIZE.1, |c, r| depth[(c, r)].is_some()),
            camera: CAMERA,
            timestamp_s: None,
            camera_from_input: Some(scaled.after(&input_from_object.inverse())),
            depth: Some(Grid::from_fn(SIZE.0, SIZE.1, |c, r| {
                depth[(c, r)].map_or(0.0, |z| (z / alpha) as f32)
            })),
            depth_deviation: None,
        }
    });
    Sequence::new(SequenceContent {
        name: "box-car".into(),
        frames: frames.collect(),
        motion_deviation: None,
        focal_deviation: None,
        truth: None,
    })
    .unwrap()
}

/// Where along `ray` from `origin` the box begins.
fn meet(
    (low, high): &(Vector3<f64>, Vector3<f64>),
    origin: &Vector3<f64>,
    ray: &Vector3<f64>,
) -> Option<f64> {
    let (a, b) = (
        (low - origin).component_div(ray),
        (high - origin).component_div(ray),
    );
    let (near, far) = (a.inf(&b).max(), a.sup(&b).min());
    (near < far && near > 0.0).then_some(near)
}
