//! Eq. 13, corrected: the camera motion of the off-the-shelf reconstruction, brought to the object's frame.

use crate::geometry::{Pose, RelativePose};

/// Every frame's `camera_from_object` from that of frame `target`, the off-the-shelf poses (`camera_from_input`, one per
/// frame) and α:
///
/// Δω_l: R'_l R'_0ᵀ, Δt_l = R'_l R'_0ᵀ t0 + α (t'_l − R'_l R'_0ᵀ t'_0) − t0.
///
/// Eq. 13 as printed lacks the −t0 that its own composition rule (Eq. 3) asks for.
pub fn cameras_from_input(
    target_from_object: &Pose,
    target: usize,
    camera_from_input: &[Pose],
    alpha: f64,
) -> Vec<Pose> {
    let input_from_target = camera_from_input[target].inverse();
    let motion = |source_from_input: &Pose| {
        let source_from_target = source_from_input.after(&input_from_target);
        let target_translation = target_from_object.translation;
        RelativePose(Pose {
            rotation: source_from_target.rotation,
            translation: source_from_target.rotation * target_translation
                + alpha * source_from_target.translation
                - target_translation,
        })
    };
    let cameras = camera_from_input
        .iter()
        .enumerate()
        .map(|(l, source_from_input)| {
            if l == target {
                *target_from_object
            } else {
                motion(source_from_input).compose(target_from_object)
            }
        });
    cameras.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};
    use std::f64::consts::FRAC_PI_2;

    /// A camera that walks a quarter circle around the object: on the spot in the object's frame, α = 0.5.
    #[test]
    fn a_quarter_turn_by_hand() {
        let target_from_object = Pose {
            rotation: Rotation3::identity(),
            translation: Vector3::new(0.0, 0.0, 2.0),
        };
        let quarter = Rotation3::from_scaled_axis(Vector3::new(0.0, FRAC_PI_2, 0.0));
        let input = [
            Pose {
                rotation: Rotation3::identity(),
                translation: Vector3::new(0.0, 0.0, 4.0),
            },
            Pose {
                rotation: quarter,
                translation: Vector3::new(0.0, 0.0, 4.0),
            },
        ];
        let source = cameras_from_input(&target_from_object, 0, &input, 0.5)[1];
        assert!((source.translation - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
        assert!((source.rotation.matrix() - quarter.matrix()).norm() < 1e-12);
        // The translation does not move at all: that is what −t0 is for.
        let motion = RelativePose::between(&target_from_object, &source);
        assert!(motion.0.translation.norm() < 1e-12);
        // And back, from the source as the target.
        let back = cameras_from_input(&source, 1, &input, 0.5);
        assert!((back[0].translation - target_from_object.translation).norm() < 1e-12);
        assert!((back[0].rotation.matrix() - target_from_object.rotation.matrix()).norm() < 1e-12);
        assert_eq!(back[1], source);
    }
}
