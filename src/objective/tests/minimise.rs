//! Calls of the minimiser.

use super::*;

/// L-BFGS moves in scaled coordinates while it runs, and in no others afterwards.
#[test]
fn both_minimisers_and_both_evaluations_find_the_same_minimum() {
    // The smooth terms, which have one minimum.
    let options = only(|o| {
        o.inverse_depth_weight = 1000.0;
        o.inverse_depth_huber = 10.0;
        o.style_weight = 2.0;
    });
    let (sequence, at) = (sequence(3), estimate(3));
    let footage = Footage::new(&sequence, 1).unwrap();
    let end = |minimiser: Minimiser, evaluation: Evaluation| {
        let Setting {
            mut objective,
            mut at,
            visibility,
        } = setting(&footage, &options, &at);
        let call = Call {
            block: Block::Style,
            free_alpha: true,
            minimiser,
            evaluation,
            max_iterations: 60,
            tolerance: 1e-9,
        };
        let outcome = objective
            .minimise(&mut at, &visibility, &call, &mut |_| true)
            .unwrap();
        assert!(outcome.evaluations.jacobian < 300, "{:?}", outcome.evaluations);
        objective.evaluate(&at, &visibility).unwrap().total
    };
    let start = value(&sequence, &options, &at).total;
    let lm = end(Minimiser::lm(LinearSolver::Auto), Evaluation::Accumulated);
    assert!(lm < 0.9 * start, "{start} {lm}");
    for (minimiser, evaluation, accuracy) in [
        (Minimiser::lm(LinearSolver::Auto), Evaluation::Blocks, 1e-9),
        (Minimiser::lbfgs(20), Evaluation::Accumulated, 1e-3),
        (Minimiser::lbfgs(20), Evaluation::Blocks, 1e-3),
    ] {
        let found = end(minimiser, evaluation);
        assert!(
            (found - lm).abs() < accuracy * lm,
            "{minimiser:?} {evaluation:?}: {lm} {found}"
        );
    }
}

/// Every step of Algorithm 1 moves what it says, and threads change no byte.
#[test]
fn a_call_moves_its_block_alone_whatever_the_threads() {
    let (sequence, at) = (sequence(4), estimate(4));
    let footage = Footage::new(&sequence, 1).unwrap();
    let moved = |block, threads| {
        let mut objective = Objective::new(
            &footage,
            Arc::new(Blob::new(600)),
            &ObjectiveOptions::default(),
            1,
            &at,
            threads,
        )
        .unwrap();
        let visibility = objective.visibility(&at, 0).unwrap();
        let call = Call {
            block,
            free_alpha: false,
            minimiser: Minimiser::lm(LinearSolver::Auto),
            evaluation: Evaluation::Accumulated,
            max_iterations: 5,
            tolerance: 0.0,
        };
        let mut found = at.clone();
        objective
            .minimise(&mut found, &visibility, &call, &mut |_| true)
            .unwrap();
        found
    };
    let relative = |estimate: &Estimate, l: usize| {
        let poses = &estimate.camera_from_object;
        RelativePose::between(&poses[1], &poses[l]).0.to_twist()
    };
    for block in [Block::All, Block::Target, Block::Motion, Block::Style] {
        let found = moved(block, 1);
        assert_eq!(found, moved(block, 3), "{block:?}");
        let changed = |l: usize| (relative(&found, l) - relative(&at, l)).norm() > 1e-9;
        let target = (found.camera_from_object[1].to_twist() - at.camera_from_object[1].to_twist()).norm();
        assert_eq!(
            target > 1e-9,
            matches!(block, Block::All | Block::Target),
            "{block:?}"
        );
        assert_eq!(
            changed(0) && changed(2) && changed(3),
            matches!(block, Block::All | Block::Motion),
            "{block:?}"
        );
        assert_eq!(
            found.style != at.style,
            matches!(block, Block::All | Block::Style)
        );
        assert!((found.alpha - at.alpha).abs() < 1e-12);
    }
}

/// Masks and depths of the blob as its true cameras see it.
fn seen_by(at: &Estimate, blob: &Blob) -> Sequence {
    let mut points = vec![0.0; 3 * blob.point_count()];
    blob.points(&at.style, &mut points);
    let mut content = sequence(at.frame_count()).into_content();
    for (frame, pose) in content.frames.iter_mut().zip(&at.camera_from_object) {
        let mut depth = crate::image::DepthMap::filled(96, 80, 0.0);
        for x in points.chunks_exact(3) {
            let in_camera = pose.transform(&Vector3::from_column_slice(x));
            let pixel = frame.camera.project(&in_camera).unwrap();
            if let Some(pixel) = frame.mask.pixel_at(pixel.x, pixel.y) {
                let z = &mut depth[pixel];
                if *z == 0.0 || *z > in_camera.z as f32 {
                    *z = in_camera.z as f32;
                }
            }
        }
        frame.mask = depth.known();
        frame.depth = Some(depth);
    }
    Sequence::new(content).unwrap()
}

/// Depths tell how far away the blob is, silhouettes how large it looks.
#[test]
fn a_focal_length_off_by_a_tenth_is_found() {
    let truth = Estimate {
        alpha: 1.0,
        ..estimate(3)
    };
    let blob = Arc::new(Blob::new(6000));
    let sequence = seen_by(&truth, &blob);
    let options = only(|o| {
        o.silhouette_weight = 1.0;
        o.inverse_depth_weight = 1e6;
        o.style_weight = 1.0;
        o.focal_deviation = Some(0.2);
    });
    let footage = Footage::new(&sequence, 1).unwrap();
    let mut found = Estimate {
        focal_factor: 1.1,
        ..truth.clone()
    };
    let mut objective = Objective::new(&footage, blob, &options, 1, &truth, 1).unwrap();
    for _ in 0..3 {
        let visibility = objective.visibility(&found, 0).unwrap();
        let call = Call {
            block: Block::All,
            free_alpha: false,
            minimiser: Minimiser::lm(LinearSolver::Auto),
            evaluation: Evaluation::Accumulated,
            max_iterations: 20,
            tolerance: 1e-6,
        };
        objective
            .minimise(&mut found, &visibility, &call, &mut |_| true)
            .unwrap();
    }
    assert!((found.focal_factor - 1.0).abs() < 0.02, "{}", found.focal_factor);
}
