//! The measures of Sec. 3.2 that one pose has, the shape's Chamfer distance, and summaries over frames.

use crate::geometry::{Pose, Rotation3, Vector3};
use crate::surface::Neighbours;

/// The angle of the rotation between the two, in \[0°, 180°\].
pub fn orientation_error_deg(a: &Rotation3<f64>, b: &Rotation3<f64>) -> f64 {
    // atan2 of sine and cosine: acos alone loses angles below 1e-6°.
    let between = a.rotation_to(b);
    let matrix = between.matrix();
    let twice_sine = Vector3::new(
        matrix[(2, 1)] - matrix[(1, 2)],
        matrix[(0, 2)] - matrix[(2, 0)],
        matrix[(1, 0)] - matrix[(0, 1)],
    )
    .norm();
    twice_sine.atan2(matrix.trace() - 1.0).to_degrees()
}

/// The distance of the cameras' centres, in units of the frame that both poses map from.
pub fn location_error(a: &Pose, b: &Pose) -> f64 {
    (a.center() - b.center()).norm()
}

/// ½ (mean distance from a to its nearest in b + mean distance from b to its nearest in a); `None` if either is
/// empty.
pub fn chamfer(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Option<f64> {
    Some(0.5 * (mean_nearest(a, b)? + mean_nearest(b, a)?))
}

fn mean_nearest(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Option<f64> {
    let tree = Neighbours::new(to);
    let distances: Option<Vec<f64>> = from
        .iter()
        .map(|point| tree.nearest(point, 1).first().map(|&(_, distance)| distance))
        .collect();
    distances
        .filter(|distances| !distances.is_empty())
        .map(|distances| distances.iter().sum::<f64>() / distances.len() as f64)
}

/// Mean and maximum over frames.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MeanMax {
    /// The arithmetic mean.
    pub mean: f64,
    /// The largest value.
    pub max: f64,
}

impl MeanMax {
    /// `None` without a value.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<_> = values.into_iter().collect();
        (!values.is_empty()).then(|| Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn about(axis: [f64; 3], angle_deg: f64) -> Rotation3<f64> {
        Rotation3::from_scaled_axis(Vector3::from(axis).normalize() * angle_deg.to_radians())
    }

    proptest! {
        #[test]
        fn orientation_error_is_the_angle_between(axis in proptest::array::uniform3(0.1..1.0f64), angle in 0.0..180.0f64,
                                                  base in proptest::array::uniform3(-3.0..3.0f64)) {
            let base = Rotation3::from_scaled_axis(Vector3::from(base));
            let error = orientation_error_deg(&base, &(about(axis, angle) * base));
            prop_assert!((error - angle).abs() < 1e-6, "{error} for {angle}");
        }
    }

    #[test]
    fn tiny_angles_are_resolved() {
        let error = orientation_error_deg(&Rotation3::identity(), &about([1.0, 2.0, 3.0], 1e-9));
        assert!((error - 1e-9).abs() < 1e-14, "{error}");
    }

    #[test]
    fn location_error_is_between_centres_not_translations() {
        let center = Vector3::new(1.0, 2.0, 2.0);
        let looking = |rotation: Rotation3<f64>, center: Vector3<f64>| Pose {
            rotation,
            translation: -(rotation * center),
        };
        let a = looking(about([0.0, 1.0, 0.0], 70.0), center);
        let b = looking(about([1.0, 1.0, 0.0], 30.0), center + Vector3::new(0.0, 0.3, 0.4));
        assert!((location_error(&a, &b) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn chamfer_is_half_of_both_means() {
        let a = [Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0)];
        let b = [Vector3::new(0.0, 0.5, 0.0)];
        // a to b: (0.5 + √1.25) / 2; b to a: 0.5.
        let expected = 0.5 * ((0.5 + 1.25f64.sqrt()) / 2.0 + 0.5);
        assert!((chamfer(&a, &b).unwrap() - expected).abs() < 1e-6);
        assert_eq!(chamfer(&a, &[]), None);
        assert_eq!(chamfer(&[], &a), None);
    }
}
