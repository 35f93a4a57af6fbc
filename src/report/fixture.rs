//! A made-up solve for tests: a box-like car on a turning platform.

use super::Surface;
use crate::cad::orbit;
use crate::geometry::{Pinhole, Pose, Rotation3, Vector3};
use crate::image::Grid;
use crate::init::Estimate;
use crate::sequence::{Frame, Sequence, SequenceContent, Truth};
use crate::solver::{Evaluations, HypothesisOutcome, ObjectiveValue, Solution, Termination, TraceRow};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points at random on a sphere.
pub(crate) fn sphere(count: usize, radius: f64, seed: u64) -> Vec<Vector3<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let (y, angle) = (
                2.0 * random.random::<f64>() - 1.0,
                std::f64::consts::TAU * random.random::<f64>(),
            );
            let ring = (1.0 - y * y).sqrt();
            radius * Vector3::new(ring * angle.cos(), y, ring * angle.sin())
        })
        .collect()
}

/// Centres and sizes of the body and the cabin.
pub(crate) const CAR_BOXES: [(Vector3<f64>, Vector3<f64>); 2] = [
    (Vector3::new(0.0, -0.05, 0.0), Vector3::new(0.38, 0.14, 0.88)),
    (Vector3::new(0.0, 0.07, 0.1), Vector3::new(0.3, 0.1, 0.42)),
];

/// Points at random on a body with a smaller cabin toward the rear (+z); the object frame's box has diagonal 1.
pub(crate) fn box_car(count: usize) -> Vec<Vector3<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let (centre, size) = CAR_BOXES[usize::from(random.random::<f64>() > 0.72)];
        let mut point = Vector3::from_fn(|i, _| size[i] * (random.random::<f64>() - 0.5));
        let areas = [size.y * size.z, size.z * size.x, size.x * size.y];
        let mut pick = random.random::<f64>() * areas.iter().sum::<f64>();
        let axis = areas.iter().position(|area| {
            pick -= area;
            pick < 0.0
        });
        let axis = axis.unwrap_or(2);
        point[axis] = size[axis] * if random.random::<f64>() < 0.5 { -0.5 } else { 0.5 };
        let point = centre + point;
        let inside = CAR_BOXES.iter().any(|(centre, size)| {
            (point - centre)
                .abs()
                .iter()
                .zip(size)
                .all(|(p, s)| *p < 0.499 * s)
        });
        if !inside {
            points.push(point);
        }
    }
    points
}

/// A sequence that was rendered from `surface`, whose off-the-shelf poses are the true ones in a frame of their own
/// (`object_from_input` has scale 0.4), and the solution that finds the truth.
pub(crate) fn solved(surface: &Surface, frame_count: usize) -> (Sequence, Solution) {
    let camera = Pinhole {
        fx: 330.0,
        fy: 330.0,
        cx: 160.0,
        cy: 100.0,
    };
    let alpha = 0.4;
    let input_in_object = Pose {
        rotation: Rotation3::from_scaled_axis(Vector3::new(0.4, -1.1, 0.3)),
        translation: Vector3::new(0.2, 0.1, -0.3),
    };
    let poses: Vec<_> = (0..frame_count)
        .map(|i| orbit(25.0 + 12.0 * i as f64, 14.0, 1.35))
        .collect();
    let views: Vec<_> = poses
        .iter()
        .map(|pose| surface.render(&camera, pose, (320, 200)))
        .collect();
    let frames = poses.iter().zip(&views).enumerate().map(|(i, (pose, view))| {
        let input = pose.after(&input_in_object);
        Frame {
            name: format!("frame_{i:03}.png"),
            image: Grid::from_fn(320, 200, |column, row| shade(surface, view, (column, row))).into(),
            mask: view.mask(),
            camera,
            timestamp_s: Some(0.5 * i as f64),
            camera_from_input: Some(Pose {
                translation: input.translation / alpha,
                ..input
            }),
            depth: None,
            depth_deviation: None,
        }
    });
    let sequence = Sequence::new(SequenceContent {
        name: "box car".into(),
        frames: frames.collect(),
        motion_deviation: None,
        focal_deviation: None,
        truth: Some(Truth {
            camera_from_object: poses.clone(),
            depth: views.iter().map(|view| view.depth.clone()).collect(),
            shape: surface
                .points()
                .iter()
                .map(|p| p.map(|c| c as f32).into())
                .collect(),
        }),
    })
    .unwrap();
    let objective = |total| ObjectiveValue {
        total,
        silhouette: total,
        ..Default::default()
    };
    let estimate = Estimate {
        camera_from_object: poses,
        style: vec![0.5, -1.0],
        alpha,
        focal_factor: 1.0,
    };
    let solution = Solution {
        estimate,
        free_form: Vec::new(),
        deviations: None,
        canonical_from_shape: None,
        objective_start: objective(9.0),
        objective_end: objective(4.0),
        evaluations: Evaluations {
            residual: 12,
            jacobian: 10,
        },
        iterations: 10,
        termination: Termination::Converged,
        hypotheses: vec![HypothesisOutcome {
            azimuth_deg: 25.0,
            elevation_deg: 14.0,
            roll_deg: 0.0,
            template_iou: 0.9,
            objective_start: 9.0,
            objective_end: 4.0,
            chosen: true,
        }],
        trace: vec![TraceRow {
            stage: "level-0".into(),
            step: 0,
            block: "all".into(),
            iteration: 0,
            objective: objective(9.0),
            gradient_norm: 2.0,
            alpha,
            residual_evaluations: 1,
            jacobian_evaluations: 1,
            seconds: 0.25,
        }],
        steps: Vec::new(),
        seconds: vec![("solve".into(), 1.5), ("solve".into(), 0.5)],
    };
    (sequence, solution)
}

/// A red body and a blue cabin on grey ground.
fn shade(surface: &Surface, view: &super::ZBuffer, at: (usize, usize)) -> [f32; 3] {
    let Some(point) = view.index[at] else {
        return [90.0 + at.1 as f32 / 4.0; 3];
    };
    let (point, normal) = (
        surface.points()[point as usize],
        surface.normals()[point as usize],
    );
    let light = (0.6 + 0.4 * normal.dot(&Vector3::new(0.3, 0.8, -0.5))) as f32;
    let paint = if point.y > 0.03 {
        [60.0, 80.0, 110.0]
    } else {
        [200.0, 40.0, 30.0]
    };
    paint.map(|part: f32| (part * light).clamp(0.0, 255.0))
}
