//! Starts at a known distance from the truth.

use crate::geometry::{Pose, Rotation3, Vector3};
use crate::init::{Estimate, cameras_from_input, scale_from_inverse_depth};
use crate::prior::{LearnedPrior, ShapePrior};
use crate::sequence::Sequence;
use crate::visibility::{Cover, visible_points};
use nalgebra::Unit;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The target frame's true pose turned by `angle_deg` about a random axis through the object and moved by
/// `share_of_distance` of its distance in a random direction; α and the motion from the off-the-shelf poses and depth by
/// Eq. 11 and 13; the mean style.
///
/// `None` unless there are a truth, depth of the target that meets the shape, and a pose for every frame.
pub fn perturbed_start(
    sequence: &Sequence,
    prior: &LearnedPrior,
    target: usize,
    angle_deg: f64,
    share_of_distance: f64,
    seed: u64,
) -> Option<Estimate> {
    let truth = sequence.truth.as_ref()?.camera_from_object.get(target)?;
    let target_from_object = perturbed_pose(truth, angle_deg, share_of_distance, seed);
    let style = vec![0.0; prior.style_len()];
    let frame = sequence.frames.get(target)?;
    let points: Vec<f64> = prior.shape(&style).iter().flat_map(|x| [x.x, x.y, x.z]).collect();
    let visible = visible_points(
        &points,
        &frame.camera,
        &target_from_object,
        frame.image.size(),
        Some(&Cover::of(prior, &style, &points)),
    );
    let alpha = scale_from_inverse_depth(&visible, &frame.mask, frame.depth.as_ref()?)?;
    let camera_from_input: Option<Vec<Pose>> = sequence
        .frames
        .iter()
        .map(|frame| frame.camera_from_input)
        .collect();
    Some(Estimate {
        camera_from_object: cameras_from_input(&target_from_object, target, &camera_from_input?, alpha),
        style,
        alpha,
        focal_factor: 1.0,
    })
}

/// `camera_from_object` turned by `angle_deg` about a random axis through the object's centre, and moved by
/// `share_of_distance` of its distance in a random direction.
pub fn perturbed_pose(camera_from_object: &Pose, angle_deg: f64, share_of_distance: f64, seed: u64) -> Pose {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let turn = Rotation3::from_axis_angle(&direction(&mut random), angle_deg.to_radians());
    let distance = camera_from_object.translation.norm();
    Pose {
        rotation: camera_from_object.rotation * turn,
        translation: camera_from_object.translation
            + direction(&mut random).into_inner() * share_of_distance * distance,
    }
}

fn direction(random: &mut ChaCha8Rng) -> Unit<Vector3<f64>> {
    loop {
        let v = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0f64));
        if (0.1..1.0).contains(&v.norm()) {
            return Unit::new_normalize(v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::orientation_error_deg;

    #[test]
    fn a_perturbed_pose_is_off_by_what_was_asked_for() {
        let pose = Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.3, 2.0, -0.5)),
            translation: Vector3::new(0.1, -0.2, 1.7),
        };
        let moved = |seed| perturbed_pose(&pose, 10.0, 0.05, seed);
        for seed in 0..5 {
            let off = (moved(seed).translation - pose.translation).norm() / pose.translation.norm();
            assert!((off - 0.05).abs() < 1e-12);
            assert!((orientation_error_deg(&moved(seed).rotation, &pose.rotation) - 10.0).abs() < 1e-9);
        }
        assert_eq!(moved(1), moved(1));
        assert_ne!(moved(1), moved(2));
    }
}
