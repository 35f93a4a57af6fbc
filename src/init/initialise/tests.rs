//! Starting points of a box-shaped car.

use super::*;
use crate::geometry::{Rotation3, Similarity, Vector3};
use crate::init::testing::{BoxCar, sequence};
use crate::sequence::SequenceContent;

/// A car on a turntable before a fixed camera, its front almost towards it at first.
fn turntable(frames: usize, step_deg: f64) -> Vec<Pose> {
    let tilt = Rotation3::from_scaled_axis(Vector3::new(std::f64::consts::PI + 0.15, 0.0, 0.0));
    (0..frames)
        .map(|i| {
            let angle = (170.0 + step_deg * i as f64).to_radians() + std::f64::consts::PI;
            Pose {
                rotation: tilt * Rotation3::from_scaled_axis(Vector3::new(0.0, angle, 0.0)),
                translation: Vector3::new(0.1, 0.05, 1.7),
            }
        })
        .collect()
}

fn quick() -> InitOptions {
    let mut options = InitOptions {
        points: 1200,
        ..InitOptions::default()
    };
    options.hypotheses.grid.elevations_deg = vec![0.0, 20.0];
    options.hypotheses.grid.rolls_deg = vec![0.0];
    options
}

fn start(sequence: &Sequence) -> Vec<Initialisation> {
    initialise(sequence, &BoxCar::new(1200), &[0.0], 0, &quick()).unwrap()
}

fn assert_close(found: &[Initialisation], truth: &[Pose], alpha: f64) {
    let angle = |start: &Initialisation| {
        let rotation = start.estimate.camera_from_object[0].rotation;
        rotation.angle_to(&truth[0].rotation).to_degrees()
    };
    let best = found.iter().min_by(|a, b| angle(a).total_cmp(&angle(b))).unwrap();
    assert!(angle(best) < 10.0, "{}", angle(best));
    assert!(
        (best.estimate.alpha / alpha - 1.0).abs() < 0.05,
        "α {}",
        best.estimate.alpha
    );
    for (frame, pose) in truth.iter().enumerate() {
        let offset = (best.estimate.camera_from_object[frame].translation - pose.translation).norm();
        assert!(offset < 0.1, "frame {frame}: {offset}");
    }
}

#[test]
fn a_turntable_is_found_with_depth_and_without() {
    let truth = turntable(9, 10.0);
    let sequence = sequence(&truth, 0.4);
    let found = start(&sequence);
    assert_eq!(found.len(), 8);
    assert!(found.is_sorted_by(|a, b| a.mean_iou >= b.mean_iou));
    assert_close(&found, &truth, 0.4);
    let without_depth = |content: &mut SequenceContent| {
        content.frames.iter_mut().for_each(|frame| frame.depth = None);
    };
    let sequence = sequence.edited(without_depth).unwrap();
    assert_close(&start(&sequence), &truth, 0.4);
    let sequence = sequence.edited(|content| content.frames[3].camera_from_input = None);
    let found = start(&sequence.unwrap());
    let cameras = &found[0].estimate.camera_from_object;
    assert_eq!(cameras.len(), 9);
    assert_eq!(cameras[3], cameras[2]);
}

#[test]
fn without_poses_each_frame_is_placed_by_its_mask() {
    let mut truth = vec![turntable(1, 0.0)[0]; 2];
    truth[1].translation += Vector3::new(0.3, -0.1, 0.4);
    let without_poses = |content: &mut SequenceContent| {
        content
            .frames
            .iter_mut()
            .for_each(|frame| frame.camera_from_input = None);
    };
    let found = start(&sequence(&truth, 1.0).edited(without_poses).unwrap());
    assert_eq!(found[0].estimate.alpha, 1.0);
    for start in &found[..2] {
        let cameras = &start.estimate.camera_from_object;
        let moved = cameras[1].translation - cameras[0].translation;
        assert!((moved - Vector3::new(0.3, -0.1, 0.4)).norm() < 0.08, "{moved}");
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let sequence = sequence(&turntable(4, 15.0), 2.0);
    assert_eq!(start(&sequence), start(&sequence));
}

#[test]
fn bad_input_is_named() {
    let sequence = sequence(&turntable(2, 15.0), 2.0);
    let car = BoxCar::new(400);
    let style = initialise(&sequence, &car, &[], 0, &quick());
    assert_eq!(style, Err(InitError::StyleLength { given: 0, wanted: 1 }));
    let mut options = quick();
    options.hypotheses.grid.azimuth_step_deg = f64::NAN;
    let message = initialise(&sequence, &car, &[0.0], 0, &options)
        .unwrap_err()
        .to_string();
    assert_eq!(message, "init option `azimuth_step_deg` is NaN; give 1 to 180");
}

/// Whichever frame is the target, the same cameras are found.
#[test]
fn any_frame_may_be_the_target() {
    let truth = turntable(7, 10.0);
    let sequence = sequence(&truth, 0.4);
    let target = 3;
    let found = initialise(&sequence, &BoxCar::new(1200), &[0.0], target, &quick()).unwrap();
    let angle = |start: &Initialisation| {
        let rotation = start.estimate.camera_from_object[target].rotation;
        rotation.angle_to(&truth[target].rotation).to_degrees()
    };
    let best = found.iter().min_by(|a, b| angle(a).total_cmp(&angle(b))).unwrap();
    assert!(angle(best) < 10.0, "{}", angle(best));
    for (camera, pose) in best.estimate.camera_from_object.iter().zip(&truth) {
        assert!((camera.translation - pose.translation).norm() < 0.1);
    }
    let message = initialise(&sequence, &BoxCar::new(400), &[0.0], 7, &quick())
        .unwrap_err()
        .to_string();
    assert_eq!(message, "the target is frame 7, but there are 7; give 0 to 6");
}

/// A car in a frame of its own: the canonical one is smaller and elsewhere.
struct Shifted(BoxCar);

fn canonical_from_shifted() -> Similarity {
    Similarity {
        scale: 0.9,
        rotation: Rotation3::identity(),
        translation: Vector3::new(0.0, 0.02, -0.05),
    }
}

impl ShapePrior for Shifted {
    fn style_len(&self) -> usize {
        self.0.style_len()
    }

    fn point_count(&self) -> usize {
        self.0.point_count()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        self.0.points(style, points);
        let shifted_from_canonical = canonical_from_shifted().inverse();
        for point in points.chunks_exact_mut(3) {
            let moved = shifted_from_canonical.transform(&Vector3::from_column_slice(point));
            point.copy_from_slice(moved.as_slice());
        }
    }

    fn jacobian(&self, style: &[f64], jacobian: &mut [f64]) {
        self.0.jacobian(style, jacobian);
        jacobian
            .iter_mut()
            .for_each(|entry| *entry /= canonical_from_shifted().scale);
    }

    fn canonical_from_shape(&self, _: &[f64], _: &[f64]) -> Option<Similarity> {
        Some(canonical_from_shifted())
    }
}

#[test]
fn earlier_cameras_are_the_canonical_frame_s() {
    let truth = turntable(3, 10.0);
    let sequence = sequence(&truth, 0.4);
    let at = |prior: &dyn ShapePrior| {
        initialise_at(&sequence, prior, (&[0.0], &[]), 0, &truth, 0.4, &quick()).unwrap()
    };
    let (canonical, shifted) = (at(&BoxCar::new(1200)), at(&Shifted(BoxCar::new(1200))));
    assert!(canonical.mean_iou > 0.9, "{}", canonical.mean_iou);
    assert_eq!(canonical.estimate.camera_from_object, truth);
    // The same pictures from another frame.
    assert!((shifted.mean_iou - canonical.mean_iou).abs() < 0.005);
    let back = shifted.estimate.in_frame(&canonical_from_shifted());
    assert!((back.alpha - 0.4).abs() < 1e-12);
    for (found, pose) in back.camera_from_object.iter().zip(&truth) {
        assert!((found.translation - pose.translation).norm() < 1e-12);
    }
}

#[test]
fn the_target_is_chosen_first() {
    assert_eq!(chosen(16, 5, 4), [5, 4, 10, 15]);
    assert_eq!(chosen(3, 1, 8), [1, 0, 2]);
}

#[test]
fn frames_are_spread_evenly() {
    assert_eq!(spread(16, 8), [0, 2, 4, 6, 8, 10, 12, 15]);
    assert_eq!(spread(3, 8), [0, 1, 2]);
    assert_eq!(spread(5, 1), [0]);
}
