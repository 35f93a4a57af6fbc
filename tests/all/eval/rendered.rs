//! A small rendered sequence, its truth, and results of it.

use spba_ceres::geometry::{Pinhole, Pose, Rotation3, Vector3};
use spba_ceres::image::Grid;
use spba_ceres::init::Estimate;
use spba_ceres::report::{ReportInput, Surface};
use spba_ceres::sequence::{Frame, Sequence, SequenceContent, Truth};
use spba_ceres::solver::{Evaluations, ObjectiveValue, Solution, Termination};
use std::path::Path;

/// An ellipsoid on a turning platform. The input's poses are true, in a frame of its own with scale 0.5.
pub fn rendered() -> (Surface, Sequence, Estimate) {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let points = (0..3000).map(|i| {
        let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / 3000.0;
        let (ring, angle) = ((1.0 - y * y).sqrt(), golden * f64::from(i));
        Vector3::new(0.2 * ring * angle.cos(), 0.15 * y, 0.4 * ring * angle.sin())
    });
    let surface = Surface::from_points(points.collect());
    let camera = Pinhole {
        fx: 150.0,
        fy: 150.0,
        cx: 64.0,
        cy: 48.0,
    };
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let poses: Vec<_> = (0..4)
        .map(|i| Pose {
            rotation: down * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.1 * f64::from(i)),
            translation: Vector3::new(0.0, 0.0, 1.5),
        })
        .collect();
    let views: Vec<_> = poses
        .iter()
        .map(|pose| surface.render(&camera, pose, (128, 96)))
        .collect();
    let frames = poses
        .iter()
        .zip(&views)
        .enumerate()
        .map(|(i, (pose, view))| Frame {
            name: format!("{i:03}.png"),
            image: Grid::filled(128, 96, [90.0; 3]).into(),
            mask: view.mask(),
            camera,
            timestamp_s: Some(i as f64),
            camera_from_input: Some(Pose {
                translation: pose.translation / 0.5,
                ..*pose
            }),
            depth: None,
            depth_deviation: None,
        });
    let sequence = Sequence::new(SequenceContent {
        name: "ellipsoid".into(),
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
    let estimate = Estimate {
        camera_from_object: poses,
        style: vec![],
        alpha: 0.5,
        focal_factor: 1.0,
    };
    (surface, sequence, estimate)
}

/// A result that says that it was solved from `input`, with the configuration `config`.
pub fn write_result_of(
    (input, config): (&Path, &str),
    surface: &Surface,
    sequence: &Sequence,
    estimate: Estimate,
    out: &Path,
) {
    let solution = Solution {
        estimate,
        free_form: Vec::new(),
        deviations: None,
        canonical_from_shape: None,
        objective_start: ObjectiveValue::default(),
        objective_end: ObjectiveValue::default(),
        evaluations: Evaluations::default(),
        iterations: 0,
        termination: Termination::Converged,
        hypotheses: vec![],
        steps: vec![],
        trace: vec![],
        seconds: vec![],
    };
    let input = ReportInput {
        sequence,
        solution: &solution,
        surface,
        input: input.to_str().unwrap(),
        prior: "none 1",
        length_m: None,
        masks_anew: &[],
        config,
        focal_deviation: 0.0,
        peak_memory_mb: None,
    };
    spba_ceres::report::write(&input, out).unwrap();
}

/// The same where the input does not matter.
pub fn write_result(surface: &Surface, sequence: &Sequence, estimate: Estimate, out: &Path) {
    write_result_of((Path::new("ellipsoid"), ""), surface, sequence, estimate, out);
}
