//! Rotations against a turning platform: with a fixed camera and an object that turns by θ_l about one axis,
//! R_l R_0ᵀ = Rot(axis, θ_l) in the frame of camera 0.

use super::{MeanMax, orientation_error_deg};
use crate::geometry::{Rotation3, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Unit};
use serde::Serialize;

/// How far each rotation is from the best-fitting platform.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TurnErrors {
    /// The turning axis in the frame of camera 0.
    pub axis: [f64; 3],
    /// Added to every predicted angle: timestamps tick.
    pub offset_deg: f64,
    /// The angle between each frame's rotation and the platform's, degrees.
    pub errors_deg: Vec<f64>,
    /// Mean and maximum of `errors_deg`, degrees.
    pub summary: MeanMax,
}

const ITERATIONS: usize = 50;
const STEP: f64 = 1e-6;

/// Finds the axis and the constant offset that minimise the sum of squared angles between R_l R_0ᵀ and
/// Rot(axis, θ_l + offset) over all frames, frame 0 included, and returns those angles.
///
/// `camera_from_object` holds R_l, `angles` the platform's θ_l in radians, signed by its sense. `None` if there are
/// fewer than three frames or they do not turn.
pub fn against_turn(camera_from_object: &[Rotation3<f64>], angles: &[f64]) -> Option<TurnErrors> {
    let first = camera_from_object.first()?;
    if camera_from_object.len() < 3 || camera_from_object.len() != angles.len() {
        return None;
    }
    let turned: Vec<_> = camera_from_object
        .iter()
        .map(|rotation| rotation * first.inverse())
        .collect();
    let mut fit = Fit {
        axis: start_axis(&turned, angles)?,
        offset: 0.0,
    };
    for _ in 0..ITERATIONS {
        let (next, step) = fit.gauss_newton(&turned, angles)?;
        fit = next;
        if step < 1e-12 {
            break;
        }
    }
    let errors_deg: Vec<_> = turned
        .iter()
        .zip(angles)
        .map(|(turned, angle)| orientation_error_deg(turned, &fit.predicted(*angle)))
        .collect();
    Some(TurnErrors {
        axis: fit.axis.into_inner().into(),
        offset_deg: fit.offset.to_degrees(),
        summary: MeanMax::of(errors_deg.iter().copied())?,
        errors_deg,
    })
}

/// The mean of the rotation vectors from each frame to the next, turned to where the angle grows.
fn start_axis(turned: &[Rotation3<f64>], angles: &[f64]) -> Option<Unit<Vector3<f64>>> {
    let sum = turned
        .windows(2)
        .zip(angles.windows(2))
        .map(|(rotations, angles)| {
            let step = rotations[1] * rotations[0].inverse();
            step.scaled_axis() * (angles[1] - angles[0]).signum()
        });
    Unit::try_new(sum.sum::<Vector3<f64>>(), 1e-6)
}

#[derive(Clone, Copy)]
struct Fit {
    axis: Unit<Vector3<f64>>,
    offset: f64,
}

impl Fit {
    fn predicted(&self, angle: f64) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&self.axis, angle + self.offset)
    }

    /// Moved by a tilt of the axis (two directions across it) and a change of the offset.
    fn moved(&self, change: &Vector3<f64>) -> Self {
        let across = self.axis.cross(&Vector3::ith(self.axis.iamin(), 1.0)).normalize();
        let along = self.axis.cross(&across);
        Self {
            axis: Unit::new_normalize(self.axis.into_inner() + change.x * across + change.y * along),
            offset: self.offset + change.z,
        }
    }

    /// The rotation vector from prediction to measurement; its length is the angle between them.
    fn residual(&self, turned: &Rotation3<f64>, angle: f64) -> Vector3<f64> {
        // Through the quaternion: the matrix's trace alone loses small angles.
        UnitQuaternion::from_rotation_matrix(&(self.predicted(angle).inverse() * turned)).scaled_axis()
    }

    /// The next fit and the length of the step; derivatives by central differences.
    fn gauss_newton(&self, turned: &[Rotation3<f64>], angles: &[f64]) -> Option<(Self, f64)> {
        let (mut normal, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
        for (turned, &angle) in turned.iter().zip(angles) {
            let columns = [0, 1, 2].map(|k| {
                let change = Vector3::ith(k, STEP);
                let ahead = self.moved(&change).residual(turned, angle);
                (ahead - self.moved(&-change).residual(turned, angle)) / (2.0 * STEP)
            });
            let jacobian = Matrix3::from_columns(&columns);
            normal += jacobian.transpose() * jacobian;
            gradient += jacobian.transpose() * self.residual(turned, angle);
        }
        let step = -normal.try_inverse()? * gradient;
        step.iter()
            .all(|part| part.is_finite())
            .then(|| (self.moved(&step), step.norm()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn platform(axis: Vector3<f64>, base: &Rotation3<f64>, angles_deg: &[f64]) -> Vec<Rotation3<f64>> {
        let axis = Unit::new_normalize(axis);
        angles_deg
            .iter()
            .map(|angle| Rotation3::from_axis_angle(&axis, angle.to_radians()) * base)
            .collect()
    }

    fn radians(angles_deg: &[f64]) -> Vec<f64> {
        angles_deg.iter().map(|angle| angle.to_radians()).collect()
    }

    proptest! {
        #[test]
        fn an_exact_turn_has_no_error(axis in proptest::array::uniform3(-1.0..1.0f64), base in proptest::array::uniform3(-2.0..2.0f64)) {
            let axis = Vector3::from(axis) + Vector3::new(0.0, 1.2, 0.0);
            let base = Rotation3::from_scaled_axis(Vector3::from(base));
            // Beyond half a turn, where rotation vectors wrap.
            let angles: Vec<f64> = (0..20).map(|i| 14.0 * f64::from(i)).collect();
            let errors = against_turn(&platform(axis, &base, &angles), &radians(&angles)).unwrap();
            prop_assert!(errors.summary.max < 1e-6, "{errors:?}");
            prop_assert!((Vector3::from(errors.axis) - axis.normalize()).norm() < 1e-8);
        }
    }

    #[test]
    fn the_sense_turns_the_axis() {
        let angles = [0.0, 10.0, 25.0, 30.0];
        let rotations = platform(Vector3::y(), &Rotation3::identity(), &angles);
        let errors = against_turn(&rotations, &radians(&angles.map(|angle| -angle))).unwrap();
        assert!(
            errors.summary.max < 1e-6 && (errors.axis[1] + 1.0).abs() < 1e-9,
            "{errors:?}"
        );
    }

    #[test]
    fn the_offset_takes_the_mean_tick_and_the_rest_is_error() {
        // Frame 0 was taken 3° before what its time says; nothing else is wrong. With n frames the best offset is
        // 3° · (n − 1) / n, and the errors are that and 3° / n.
        let times = [0.0, 20.0, 40.0, 60.0, 80.0];
        let real = [0.0, 23.0, 43.0, 63.0, 83.0];
        let rotations = platform(Vector3::new(0.1, 1.0, -0.2), &Rotation3::identity(), &real);
        let errors = against_turn(&rotations, &radians(&times)).unwrap();
        assert!((errors.offset_deg - 2.4).abs() < 1e-6, "{errors:?}");
        assert!((errors.errors_deg[0] - 2.4).abs() < 1e-6);
        assert!((errors.errors_deg[3] - 0.6).abs() < 1e-6);
    }

    #[test]
    fn one_wrong_frame_shows() {
        let angles: Vec<f64> = (0..16).map(|i| 5.0 * f64::from(i)).collect();
        let mut rotations = platform(Vector3::y(), &Rotation3::identity(), &angles);
        rotations[9] = Rotation3::from_scaled_axis(Vector3::new(4f64.to_radians(), 0.0, 0.0)) * rotations[9];
        let errors = against_turn(&rotations, &radians(&angles)).unwrap();
        assert!((errors.errors_deg[9] - 4.0).abs() < 0.5, "{errors:?}");
        assert_eq!(errors.summary.max, errors.errors_deg[9]);
    }

    #[test]
    fn what_does_not_turn_has_no_axis() {
        let still = vec![Rotation3::identity(); 5];
        assert!(against_turn(&still, &[0.0; 5]).is_none());
        assert!(against_turn(&still[..2], &[0.0, 1.0]).is_none());
    }
}
