//! Rigid poses and the paper's composition rule (Eq. 2–3), in which the relative rotation turns the global
//! rotation but *not* the global translation.

use nalgebra::{Rotation3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// A rigid transform `b_from_a`: `x_b = rotation x_a + translation`.
///
/// ```
/// use spba_ceres::geometry::{Pose, Rotation3, Vector3};
///
/// let camera_from_object = Pose {
///     rotation: Rotation3::identity(),
///     translation: Vector3::new(0.0, 0.0, 2.0),
/// };
/// let centre_of_object = camera_from_object.transform(&Vector3::zeros());
/// assert_eq!(centre_of_object.z, 2.0); // two diagonals before the camera
/// assert_eq!(camera_from_object.center().z, -2.0); // the camera in the object frame
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The rotation R of `x_b = R x_a + t`.
    pub rotation: Rotation3<f64>,
    /// The translation t of `x_b = R x_a + t`, in units of both frames.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// The pose that leaves every point where it is.
    pub fn identity() -> Self {
        Self {
            rotation: Rotation3::identity(),
            translation: Vector3::zeros(),
        }
    }

    /// p = [ω; t] (Eq. 1): ω is the rotation vector in radians.
    pub fn from_twist(twist: &Vector6<f64>) -> Self {
        Self {
            rotation: Rotation3::from_scaled_axis(twist.fixed_rows::<3>(0).into_owned()),
            translation: twist.fixed_rows::<3>(3).into_owned(),
        }
    }

    /// The inverse of [`Pose::from_twist`], with ‖ω‖ ≤ π.
    pub fn to_twist(&self) -> Vector6<f64> {
        let omega = rotation_vector(&self.rotation);
        Vector6::new(
            omega.x,
            omega.y,
            omega.z,
            self.translation.x,
            self.translation.y,
            self.translation.z,
        )
    }

    /// The point `x_b` in frame b of `x_a` in frame a.
    pub fn transform(&self, point_in_a: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point_in_a + self.translation
    }

    /// The inverse transform `a_from_b`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// `c_from_a` from `c_from_b` (self) and `b_from_a`: the usual rigid composition.
    pub fn after(&self, b_from_a: &Pose) -> Self {
        Self {
            rotation: self.rotation * b_from_a.rotation,
            translation: self.rotation * b_from_a.translation + self.translation,
        }
    }

    /// Where the origin of frame b lies in frame a: the camera's centre for a `camera_from_object`.
    pub fn center(&self) -> Vector3<f64> {
        self.inverse().translation
    }
}

/// Δp_l = [Δω_l; Δt_l]: a source frame's pose relative to the target's, as Eq. 2–3 define it. It is *not* a
/// rigid transform between the two cameras, so it has a type of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelativePose(pub Pose);

impl RelativePose {
    /// p_l from p0 (Eq. 2–3): R_l = R(Δω_l) R(ω0), t_l = Δt_l + t0.
    pub fn compose(&self, target_from_object: &Pose) -> Pose {
        Pose {
            rotation: self.0.rotation * target_from_object.rotation,
            translation: self.0.translation + target_from_object.translation,
        }
    }

    /// The Δp_l with `compose(target_from_object) == source_from_object`.
    pub fn between(target_from_object: &Pose, source_from_object: &Pose) -> Self {
        Self(Pose {
            rotation: source_from_object.rotation * target_from_object.rotation.inverse(),
            translation: source_from_object.translation - target_from_object.translation,
        })
    }
}

fn rotation_vector(rotation: &Rotation3<f64>) -> Vector3<f64> {
    // Through the quaternion: near π the matrix's antisymmetric part vanishes and the axis with it.
    nalgebra::UnitQuaternion::from_rotation_matrix(rotation).scaled_axis()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn any_pose() -> impl Strategy<Value = Pose> {
        (
            proptest::array::uniform3(-1.0..1.0f64),
            0.0..std::f64::consts::PI,
            proptest::array::uniform3(-3.0..3.0f64),
        )
            .prop_map(|(axis, angle, t)| {
                let axis = Vector3::from(axis) + Vector3::new(1e-3, 0.0, 0.0);
                Pose {
                    rotation: Rotation3::from_scaled_axis(axis.normalize() * angle),
                    translation: Vector3::from(t),
                }
            })
    }

    fn close(a: &Pose, b: &Pose) -> bool {
        (a.rotation.matrix() - b.rotation.matrix()).norm() < 1e-9
            && (a.translation - b.translation).norm() < 1e-9
    }

    proptest! {
        #[test]
        fn twist_round_trips(pose in any_pose()) {
            prop_assert!(close(&Pose::from_twist(&pose.to_twist()), &pose));
        }

        #[test]
        fn inverse_undoes(pose in any_pose()) {
            prop_assert!(close(&pose.after(&pose.inverse()), &Pose::identity()));
        }

        #[test]
        fn rigid_composition_is_associative(a in any_pose(), b in any_pose(), c in any_pose()) {
            prop_assert!(close(&a.after(&b).after(&c), &a.after(&b.after(&c))));
        }

        #[test]
        fn between_inverts_compose(target in any_pose(), source in any_pose()) {
            prop_assert!(close(&RelativePose::between(&target, &source).compose(&target), &source));
        }

        #[test]
        fn the_relative_rotation_leaves_the_translation_alone(delta in any_pose(), target in any_pose()) {
            let source = RelativePose(delta).compose(&target);
            prop_assert!((source.translation - delta.translation - target.translation).norm() < 1e-12);
            prop_assert!((source.rotation.matrix() - (delta.rotation * target.rotation).matrix()).norm() < 1e-12);
        }
    }

    #[test]
    fn twists_at_zero_and_at_pi() {
        for omega in [
            Vector3::zeros(),
            Vector3::new(0.0, std::f64::consts::PI - 1e-9, 0.0),
            Vector3::new(1e-12, 0.0, 0.0),
        ] {
            let pose = Pose {
                rotation: Rotation3::from_scaled_axis(omega),
                translation: Vector3::new(1.0, 2.0, 3.0),
            };
            assert!(close(&Pose::from_twist(&pose.to_twist()), &pose), "{omega}");
        }
    }
}
