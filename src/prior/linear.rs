//! The linear prior: X(s) = mean + Σ s_k σ_k mode_k, the standard deviations folded into the basis.

use super::{AxisStyles, ShapePrior};
use nalgebra::Vector3;
use std::ops::Range;

/// A mean shape and S modes over N points, object frame.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPrior {
    /// 3N entries, xyz after xyz.
    mean: Vec<f64>,
    /// 3N rows of S entries, row-major: ∂X/∂s.
    basis: Vec<f64>,
    style_len: usize,
    /// What the last styles are.
    axis_styles: Vec<AxisStyles>,
    normals: Vec<[f32; 3]>,
}

/// Why arrays do not make a linear prior.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPrior {
    /// An array has not as many numbers as it should.
    #[error("{what} holds {found} numbers, {expected} expected")]
    Length {
        /// The array.
        what: &'static str,
        /// The numbers that it has.
        found: usize,
        /// The numbers that it should have.
        expected: usize,
    },
    /// The prior has no point.
    #[error("there are no points")]
    Empty,
    /// An array holds a number that is infinite or not a number.
    #[error("{what} holds a number that is not finite, at index {index}")]
    NotFinite {
        /// The array.
        what: &'static str,
        /// The index of the first such number.
        index: usize,
    },
    /// A normal does not have length 1. The field is its index.
    #[error("normal {0} is not of unit length")]
    NotUnit(usize),
    /// A point names a face that does not exist.
    #[error("point {index} lies on no face of the {faces}")]
    NoFace {
        /// The point's index.
        index: usize,
        /// The faces of the mesh.
        faces: usize,
    },
    /// The mesh of a prior of surfaces is wrong.
    #[error(transparent)]
    Mesh(#[from] super::InvalidMesh),
}

impl LinearPrior {
    /// `mean` has 3N entries, `basis` 3N rows of `style_len`, `normals` N; points in farthest-point order.
    pub fn new(
        mean: Vec<f64>,
        basis: Vec<f64>,
        style_len: usize,
        normals: Vec<[f32; 3]>,
    ) -> Result<Self, InvalidPrior> {
        let length = |what, found, expected| {
            if found == expected {
                Ok(())
            } else {
                Err(InvalidPrior::Length {
                    what,
                    found,
                    expected,
                })
            }
        };
        if mean.is_empty() {
            return Err(InvalidPrior::Empty);
        }
        length("the mean", mean.len(), mean.len() / 3 * 3)?;
        length("the basis", basis.len(), mean.len() * style_len)?;
        length("the normals", normals.len(), mean.len() / 3)?;
        for (what, values) in [("the mean", &mean), ("the basis", &basis)] {
            if let Some(index) = values.iter().position(|x| !x.is_finite()) {
                return Err(InvalidPrior::NotFinite { what, index });
            }
        }
        let unit = |n: &[f32; 3]| (Vector3::from(*n).norm() - 1.0).abs() < 0.02;
        if let Some(index) = normals.iter().position(|n| !unit(n)) {
            return Err(InvalidPrior::NotUnit(index));
        }
        Ok(Self {
            mean,
            basis,
            style_len,
            axis_styles: Vec::new(),
            normals,
        })
    }

    /// Told what the last styles are, as the basis already has them.
    pub(super) fn with_axis_styles(self, axis_styles: Vec<AxisStyles>) -> Self {
        let told = Self { axis_styles, ..self };
        debug_assert!(
            told.basis
                .chunks_exact(told.style_len.max(1))
                .enumerate()
                .all(|(row, moved)| {
                    let mut across = told.runs().filter(|(axis, _)| *axis != row % 3);
                    across.all(|(_, styles)| moved[styles].iter().all(|&x| x == 0.0))
                })
        );
        told
    }

    /// The axis styles' axes, and which styles they are.
    fn runs(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let mut end = self.dense_style_len();
        self.axis_styles.iter().map(move |styles| {
            let begin = end;
            end += styles.count;
            (styles.axis, begin..end)
        })
    }

    /// How many styles come before the axis styles.
    fn dense_style_len(&self) -> usize {
        self.style_len - self.axis_styles.iter().map(|styles| styles.count).sum::<usize>()
    }

    /// The prior of `shapes`' first `style_len` principal components (fewer where there are fewer shapes), each shape counting by its
    /// weight, and the share of the variance explained by the first k + 1 of them.
    #[cfg(feature = "cad")]
    pub fn from_correspondences(
        shapes: &[Vec<f64>],
        weights: &[f64],
        normals: Vec<[f32; 3]>,
        style_len: usize,
    ) -> Result<(Self, Vec<f64>), InvalidPrior> {
        let found = super::learn::components(shapes, weights, style_len);
        let style_len = found.modes.len();
        let basis = (0..found.mean.len())
            .flat_map(|row| found.modes.iter().map(move |mode| mode[row]))
            .collect();
        Ok((Self::new(found.mean, basis, style_len, normals)?, found.explained))
    }

    /// X(0), 3N entries.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// ∂X/∂s, 3N rows of S entries, row-major.
    pub fn basis(&self) -> &[f64] {
        &self.basis
    }

    /// N outward unit normals of the mean shape.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }
}

impl ShapePrior for LinearPrior {
    fn style_len(&self) -> usize {
        self.style_len
    }

    fn point_count(&self) -> usize {
        self.normals.len()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        debug_assert!(style.len() == self.style_len && points.len() <= self.mean.len());
        if self.style_len == 0 {
            points.copy_from_slice(&self.mean[..points.len()]);
            return;
        }
        let dense = self.dense_style_len();
        let runs: [Vec<Range<usize>>; 3] = std::array::from_fn(|axis| {
            let of_axis = self.runs().filter(|run| run.0 == axis);
            of_axis.map(|(_, styles)| styles).collect()
        });
        let rows = self.basis.chunks_exact(self.style_len).zip(runs.iter().cycle());
        for ((out, mean), (row, runs)) in points.iter_mut().zip(&self.mean).zip(rows) {
            let along = runs
                .iter()
                .cloned()
                .map(|styles| dot(&row[styles.clone()], &style[styles]));
            *out = mean + dot(&row[..dense], &style[..dense]) + along.sum::<f64>();
        }
    }

    fn jacobian(&self, _style: &[f64], jacobian: &mut [f64]) {
        jacobian.copy_from_slice(&self.basis[..jacobian.len()]);
    }

    fn constant_jacobian(&self) -> Option<&[f64]> {
        Some(&self.basis)
    }

    fn axis_styles(&self) -> &[AxisStyles] {
        &self.axis_styles
    }
}

/// In four sums, which a processor adds up at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a_parts, b_parts) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = a_parts.remainder().iter().zip(b_parts.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in a_parts.zip(b_parts) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Four points on a unit grid, two modes.
    pub(crate) fn small() -> LinearPrior {
        let mean = vec![0.5, 0.0, 0.0, -0.5, 0.0, 0.0, 0.5, 0.5, 0.0, -0.5, 0.5, 0.0];
        let basis = (0..24).map(|i| f64::from(i) / 64.0).collect();
        LinearPrior::new(mean, basis, 2, vec![[0.0, 0.0, -1.0]; 4]).unwrap()
    }

    proptest! {
        #[test]
        fn the_jacobian_is_the_derivative(a in -2.0..2.0f64, b in -2.0..2.0f64, count in 1..5usize) {
            let prior = small();
            let (mut at, mut moved) = (vec![0.0; 3 * count], vec![0.0; 3 * count]);
            let mut jacobian = vec![0.0; 6 * count];
            prior.points(&[a, b], &mut at);
            prior.jacobian(&[a, b], &mut jacobian);
            for k in 0..2 {
                let mut style = [a, b];
                style[k] += 1e-3;
                prior.points(&style, &mut moved);
                for i in 0..3 * count {
                    prop_assert!(((moved[i] - at[i]) / 1e-3 - jacobian[2 * i + k]).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_short_slice_gets_a_prefix_of_the_mean() {
        let mut points = [0.0; 6];
        small().points(&[0.0, 0.0], &mut points);
        assert_eq!(points, [0.5, 0.0, 0.0, -0.5, 0.0, 0.0]);
    }

    #[test]
    fn arrays_that_do_not_fit_are_refused() {
        let normals = || vec![[0.0, 1.0, 0.0]];
        let refused = |mean: Vec<f64>, basis: Vec<f64>, normals| {
            LinearPrior::new(mean, basis, 1, normals).unwrap_err().to_string()
        };
        assert!(refused(vec![], vec![], vec![]).contains("no points"));
        assert!(refused(vec![0.0; 3], vec![0.0; 4], normals()).contains("basis holds 4"));
        assert!(refused(vec![0.0; 3], vec![0.0; 3], vec![]).contains("normals holds 0"));
        assert!(refused(vec![0.0, f64::NAN, 0.0], vec![0.0; 3], normals()).contains("index 1"));
        assert!(refused(vec![0.0; 3], vec![0.0; 3], vec![[0.0; 3]]).contains("unit"));
    }

    #[test]
    fn without_modes_there_is_the_mean() {
        let prior = LinearPrior::new(vec![1.0, 2.0, 3.0], vec![], 0, vec![[0.0, 1.0, 0.0]]).unwrap();
        let mut points = [0.0; 3];
        prior.points(&[], &mut points);
        assert_eq!(points, [1.0, 2.0, 3.0]);
    }
}
