//! How sure a solution is: the covariance that the curvature of Eq. 9 implies.

use crate::geometry::Pose;
use crate::init::Estimate;
use crate::objective::{Objective, ObjectiveError, Visibility};
use crate::prior::{FrameDerivative, ShapePrior};
use nalgebra::{DMatrix, Matrix3, Matrix6, OMatrix, U3, U6};

/// Standard deviations of what was found, by the Gauss–Newton matrix at the minimum. Eq. 9 over the style's weight is taken
/// for −log p: the prior's own deviations are 1, those of the result at most that. What the model does not know (masks and input poses
/// that are wrong as a whole, a wrong focal length that is held, a category that the prior does not cover) is not in them.
#[derive(Clone, Debug)]
pub struct Deviations {
    /// Frame by frame.
    pub cameras: Vec<CameraDeviation>,
    /// Of the shape's coordinates (s, g): K × K, a square root C of their covariance C Cᵀ.
    pub shape: DMatrix<f64>,
    /// How the shape moves its canonical frame; empty where the prior's frame is taken for it.
    pub frame: Vec<FrameDerivative>,
}

/// Of one camera in the canonical frame.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraDeviation {
    /// Root mean square angle, degrees.
    pub rotation_deg: f64,
    /// Root mean square distance of the camera's centre, object diagonals.
    pub location: f64,
}

impl Deviations {
    /// Of `found`, the minimum of `objective` in the prior's frame, whose style is (s, g) with `styles` entries in s. A focal length that the
    /// objective holds counts as known. `None` where the style has no weight, so that there is no unit, and where the objective does not
    /// hold every pose and coordinate. `visibility` is that of `found`, at full resolution.
    ///
    /// # Errors
    /// A failing objective.
    pub(crate) fn at(
        objective: &mut Objective,
        visibility: &Visibility,
        prior: &dyn ShapePrior,
        found: &Estimate,
        styles: usize,
    ) -> Result<Option<Self>, ObjectiveError> {
        let options = objective.options();
        let style_weight = options.style_weight;
        let finds_focal = options.focal_deviation.is_some_and(|deviation| deviation > 0.0);
        if style_weight <= 0.0 {
            return Ok(None);
        }
        let (gradient, normal_matrix) = objective.differentiate(found, visibility)?;
        let count = gradient.len();
        let first_style = 6 * found.frame_count();
        let coordinates = found.style.len();
        let normal_matrix = DMatrix::from_row_slice(count, count, &normal_matrix) / style_weight;
        // Log focal is the last variable.
        let found_count = if finds_focal { count } else { count - 1 };
        let normal_matrix = normal_matrix.resize(found_count, found_count, 0.0);
        let is_held = |i: usize| normal_matrix[(i, i)] > 0.0;
        if !(0..first_style + coordinates).all(is_held) {
            return Ok(None);
        }
        let Some(covariance) = inverse(&normal_matrix) else {
            return Ok(None);
        };
        let of_shape = covariance.view((first_style, first_style), (coordinates, coordinates));
        let Some(shape) = of_shape.into_owned().cholesky() else {
            return Ok(None);
        };
        let (style, form) = found.style.split_at(styles.min(coordinates));
        let frame = prior
            .canonical_from_shape(style, form)
            .zip(prior.canonical_by_shape(style, form));
        let cameras = found.camera_from_object.iter().enumerate().map(|(l, pose)| {
            let own = covariance.fixed_view::<6, 6>(6 * l, 6 * l).into_owned();
            let location = match &frame {
                None => squared(&center_by_twist(pose), &own),
                Some((canonical, by_shape)) => {
                    // By the twist and by the shape, which moves the frame.
                    let center = pose.center();
                    let mut derivative = DMatrix::zeros(3, 6 + coordinates);
                    derivative
                        .fixed_view_mut::<3, 6>(0, 0)
                        .copy_from(&(canonical.scale * center_by_twist(pose)));
                    for (k, by) in by_shape.iter().enumerate() {
                        derivative
                            .fixed_view_mut::<3, 1>(0, 6 + k)
                            .copy_from(&(center * by.scale + by.translation));
                    }
                    let chosen: Vec<usize> = (6 * l..6 * l + 6)
                        .chain(first_style..first_style + coordinates)
                        .collect();
                    let joint = covariance.select_rows(&chosen).select_columns(&chosen);
                    (&derivative * joint * derivative.transpose()).trace()
                }
            };
            CameraDeviation {
                rotation_deg: own.fixed_view::<3, 3>(0, 0).trace().sqrt().to_degrees(),
                location: location.sqrt(),
            }
        });
        Ok(Some(Self {
            cameras: cameras.collect(),
            shape: shape.unpack(),
            frame: frame.map_or_else(Vec::new, |(_, by_shape)| by_shape),
        }))
    }
}

/// The inverse of a symmetric matrix; rows and columns of variables on which nothing depends are 0. `None` where what is left is not positive
/// definite.
fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // In units in which the diagonal is 1: a radian, a diagonal and a style differ by orders of magnitude.
    let kept: Vec<usize> = (0..matrix.nrows()).filter(|&i| matrix[(i, i)] > 0.0).collect();
    let per_unit: Vec<f64> = kept.iter().map(|&i| matrix[(i, i)].sqrt().recip()).collect();
    let scaled = DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
        per_unit[i] * matrix[(kept[i], kept[j])] * per_unit[j]
    });
    let inverse = scaled.cholesky()?.inverse();
    let mut whole = DMatrix::zeros(matrix.nrows(), matrix.ncols());
    for (i, &row) in kept.iter().enumerate() {
        for (j, &column) in kept.iter().enumerate() {
            whole[(row, column)] = per_unit[i] * inverse[(i, j)] * per_unit[j];
        }
    }
    whole.iter().all(|x| x.is_finite()).then_some(whole)
}

/// The derivative of a camera's centre −Rᵀ t by the twist [ω; δ] that makes R into exp(\[ω\]×) R and t into t + δ.
fn center_by_twist(pose: &Pose) -> OMatrix<f64, U3, U6> {
    let back: Matrix3<f64> = -pose.rotation.matrix().transpose();
    let mut derivative = OMatrix::<f64, U3, U6>::zeros();
    derivative
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(back * pose.translation.cross_matrix()));
    derivative.fixed_view_mut::<3, 3>(0, 3).copy_from(&back);
    derivative
}

/// The trace of A Σ Aᵀ.
fn squared(derivative: &OMatrix<f64, U3, U6>, covariance: &Matrix6<f64>) -> f64 {
    (derivative * covariance * derivative.transpose()).trace()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};

    #[test]
    fn the_inverse_leaves_out_what_nothing_holds() {
        let matrix = DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 5.0]);
        let expected = [5.0, 0.0, -2.0, 0.0, 0.0, 0.0, -2.0, 0.0, 4.0].map(|x| x / 16.0);
        let found = inverse(&matrix).unwrap();
        assert!((found - DMatrix::from_row_slice(3, 3, &expected)).amax() < 1e-15);
        // Of two variables that can stand for each other, neither is known.
        assert!(inverse(&DMatrix::from_element(2, 2, 1.0)).is_none());
    }

    #[test]
    fn a_twist_moves_the_center_as_the_derivative_says() {
        let pose = Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.4, -1.1, 0.7)),
            translation: Vector3::new(0.3, -0.2, 1.7),
        };
        let derivative = center_by_twist(&pose);
        for k in 0..6 {
            let moved = |step: f64| {
                let mut twist = [0.0; 6];
                twist[k] = step;
                let turn = Rotation3::from_scaled_axis(Vector3::new(twist[0], twist[1], twist[2]));
                let moved = Pose {
                    rotation: turn * pose.rotation,
                    translation: pose.translation + Vector3::new(twist[3], twist[4], twist[5]),
                };
                moved.center()
            };
            let expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((derivative.column(k) - expected).norm() < 1e-9, "{k}");
        }
    }
}
