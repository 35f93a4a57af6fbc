use super::*;
use crate::geometry::{Pose, Rotation3, Vector3};

/// Of two minimisers from two starts, without truth.
pub(super) fn comparison() -> Comparison {
    let state = |objective, evaluations, cpu_seconds| JudgedState {
        level: None,
        objective,
        iterations: evaluations / 5,
        evaluations,
        cpu_seconds,
        rotation_error_deg: None,
        location_error_percent: None,
    };
    let minimisation = |minimiser: &str, seed, states| Minimisation {
        minimiser: minimiser.into(),
        seed,
        states,
        iterations: Vec::new(),
        termination: Termination::Converged,
        measures: Measures::default(),
    };
    let start = Estimate {
        camera_from_object: vec![Pose::identity()],
        style: vec![],
        alpha: 1.0,
        focal_factor: 1.0,
    };
    Comparison {
        sequence: "s".into(),
        frames: 1,
        perturbation: Perturbation::default(),
        starts: vec![start; 2],
        minimisers: ["a", "b"]
            .map(|name| Method::new(name, name, Config::default()))
            .to_vec(),
        minimisations: vec![
            minimisation(
                "a",
                0,
                vec![state(200.0, 0, 0.0), state(100.5, 10, 1.0), state(100.0, 20, 2.0)],
            ),
            minimisation("b", 0, vec![state(200.0, 0, 0.0), state(102.0, 30, 3.0)]),
            minimisation("a", 1, vec![state(300.0, 0, 0.0), state(200.0, 40, 5.0)]),
            minimisation("b", 1, vec![state(300.0, 0, 0.0), state(150.0, 50, 6.0)]),
        ],
    }
}

#[test]
fn seeds_keep_the_relative_motion() {
    let start = Estimate {
        camera_from_object: vec![
            Pose {
                translation: Vector3::new(0.0, 0.1, 1.7),
                ..Pose::identity()
            },
            Pose {
                rotation: Rotation3::from_scaled_axis(Vector3::new(0.0, 0.2, 0.1)),
                translation: Vector3::new(0.1, 0.1, 1.75),
            },
        ],
        style: vec![0.5],
        alpha: 0.7,
        focal_factor: 1.0,
    };
    let by = Perturbation {
        rotation_deg: 7.0,
        share_of_distance: 0.03,
    };
    assert_eq!(perturbed(&start, 1, &by, 0), start);
    let moved = perturbed(&start, 1, &by, 3);
    let relative =
        |estimate: &Estimate| estimate.camera_from_object[1].after(&estimate.camera_from_object[0].inverse());
    let (a, b) = (relative(&start), relative(&moved));
    assert!((a.to_twist() - b.to_twist()).norm() < 1e-12);
    let [before, after] = [&start, &moved].map(|estimate| estimate.camera_from_object[1]);
    let angle = orientation_error_deg(&after.rotation, &before.rotation);
    let length = (after.translation - before.translation).norm();
    assert!((angle - 7.0).abs() < 1e-9);
    assert!((length - 0.03 * before.translation.norm()).abs() < 1e-12);
}

#[test]
fn iterations_belong_to_the_call_that_they_are_of() {
    let mut comparison = comparison();
    let states = &mut comparison.minimisations[0].states;
    // The second call moved nothing.
    states.insert(2, states[1].clone());
    let row = |iteration, residual_evaluations, jacobian_evaluations| TraceRow {
        stage: "level-0".into(),
        step: 0,
        block: "all".into(),
        iteration,
        objective: Default::default(),
        gradient_norm: 0.0,
        alpha: 1.0,
        residual_evaluations,
        jacobian_evaluations,
        seconds: 0.0,
    };
    let solution = Solution {
        estimate: comparison.starts[0].clone(),
        free_form: vec![],
        deviations: None,
        canonical_from_shape: None,
        objective_start: Default::default(),
        objective_end: Default::default(),
        evaluations: Default::default(),
        iterations: 4,
        termination: Termination::Converged,
        hypotheses: vec![],
        steps: vec![],
        trace: vec![row(0, 1, 1), row(1, 5, 5), row(0, 6, 6), row(2, 10, 10)],
        seconds: vec![("solve_cpu".into(), 2.0)],
    };
    let of = iterations(&solution, states, &[10.5, 11.0, 11.5, 12.0], 12.0);
    let told: Vec<_> = of
        .iter()
        .map(|i| (i.call, i.iterations, i.evaluations, i.cpu_seconds))
        .collect();
    assert_eq!(
        told,
        [(1, 0, 2, 0.5), (1, 1, 10, 1.0), (3, 2, 12, 1.5), (3, 4, 20, 2.0)]
    );
}
