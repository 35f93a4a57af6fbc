//! Eq. 13, corrected: the camera motion of the off-the-shelf reconstruction, brought to the object's frame.

use crate::geometry::{Pose, RelativePose};

/// Δp_l for l = 1..L−1 from the target's pose p0, the off-the-shelf poses (`camera_from_input`, one per frame, the
/// target's first) and α:
///
/// Δω_l: R'_l R'_0ᵀ, Δt_l = R'_l R'_0ᵀ t0 + α (t'_l − R'_l R'_0ᵀ t'_0) − t0.
///
/// Eq. 13 as printed lacks the −t0 that its own composition rule (Eq. 3) asks for.
pub fn motion_from_input(
    target_from_object: &Pose,
    camera_from_input: &[Pose],
    alpha: f64,
) -> Vec<RelativePose> {
    let Some((target_from_input, sources)) = camera_from_input.split_first() else {
        return Vec::new();
    };
    let sources = sources.iter().map(|source_from_input| {
        let source_from_target = source_from_input.after(&target_from_input.inverse());
        let target_translation = target_from_object.translation;
        RelativePose(Pose {
            rotation: source_from_target.rotation,
            translation: source_from_target.rotation * target_translation
                + alpha * source_from_target.translation
                - target_translation,
        })
    });
    sources.collect()
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
        let motion = motion_from_input(&target_from_object, &input, 0.5);
        let source = motion[0].compose(&target_from_object);
        assert!((source.translation - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
        assert!((source.rotation.matrix() - quarter.matrix()).norm() < 1e-12);
        // The translation does not move at all: that is what −t0 is for.
        assert!(motion[0].0.translation.norm() < 1e-12);
    }

    #[test]
    fn one_frame_has_no_motion() {
        assert!(motion_from_input(&Pose::identity(), &[Pose::identity()], 1.0).is_empty());
        assert!(motion_from_input(&Pose::identity(), &[], 1.0).is_empty());
    }
}
