//! A smooth random displacement on points that is symmetric in x = 0: a Gaussian process with a squared-exponential covariance,
//! cut off at its largest modes.

use crate::geometry::mirror;
use nalgebra::{DMatrix, SymmetricEigen, Vector3};

type V3 = Vector3<f64>;

/// Eigenvalues below this share of the largest are noise of the eigensolver.
const MIN_EIGENVALUE: f64 = 1e-7;

/// Functions on points: a row a point, a column a mode, the largest first. With coefficients i.i.d. standard normal the sum of a
/// parity's modes has covariance k(p, q) ± k(p, q'), q' being the mirror image: the amplitude is that of one side.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldModes {
    /// Equal at mirror images: what moves y and z of a symmetric shape.
    pub even: DMatrix<f64>,
    /// Opposite at mirror images, 0 on the plane of symmetry: what moves x of a symmetric shape.
    pub odd: DMatrix<f64>,
}

/// One squared-exponential term of a covariance: amplitude² exp(−|p − q|² / 2 length²), both in diagonals.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FieldScale {
    /// The standard deviation of the displacement, diagonals.
    pub amplitude: f64,
    /// The distance over which displacements are alike, diagonals.
    pub length: f64,
}

/// The modes at `points`, at most `count` of each parity, of the process with the sum of `scales` as its covariance.
///
/// Nyström's method: the modes at `nodes` (points of one half), extended by the covariance itself. Nodes should be no further apart
/// than the shortest length.
pub fn field_modes(points: &[V3], nodes: &[V3], scales: &[FieldScale], count: usize) -> FieldModes {
    FieldModes {
        even: modes_of(points, nodes, scales, count, 1.0),
        odd: modes_of(points, nodes, scales, count, -1.0),
    }
}

fn modes_of(points: &[V3], nodes: &[V3], scales: &[FieldScale], count: usize, sign: f64) -> DMatrix<f64> {
    let covariance = |a: &V3, b: &V3| -> f64 {
        let term = |squared: f64, scale: &FieldScale| {
            scale.amplitude.powi(2) * (-squared / (2.0 * scale.length.powi(2))).exp()
        };
        let (near, far) = ((a - b).norm_squared(), (a - mirror(b)).norm_squared());
        scales.iter().map(|s| term(near, s) + sign * term(far, s)).sum()
    };
    let among_nodes = DMatrix::from_fn(nodes.len(), nodes.len(), |i, j| covariance(&nodes[i], &nodes[j]));
    let eigen = SymmetricEigen::new(among_nodes);
    let mut order: Vec<usize> = (0..nodes.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let largest = order.first().map_or(0.0, |&k| eigen.eigenvalues[k]);
    order.retain(|&k| eigen.eigenvalues[k] > MIN_EIGENVALUE * largest);
    order.truncate(count);
    let mut weights = eigen.eigenvectors.select_columns(&order);
    for (mut column, &k) in weights.column_iter_mut().zip(&order) {
        column *= eigen.eigenvalues[k].sqrt().recip();
        // An eigenvector's sign is the solver's whim.
        if column[column.icamax()] < 0.0 {
            column.neg_mut();
        }
    }
    DMatrix::from_fn(points.len(), nodes.len(), |i, j| {
        covariance(&points[i], &nodes[j])
    }) * weights
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Vec<V3> {
        (0..60)
            .map(|i| V3::new(0.01 + 0.5 * f64::from(i % 6) / 6.0, f64::from(i / 6) / 10.0, 0.0))
            .collect()
    }

    #[test]
    fn modes_have_the_covariance() {
        let points = line();
        let scales = [
            FieldScale {
                amplitude: 0.3,
                length: 0.2,
            },
            FieldScale {
                amplitude: 0.1,
                length: 0.1,
            },
        ];
        let FieldModes { even, odd } = field_modes(&points, &points, &scales, 60);
        let found = (&even * even.transpose() + &odd * odd.transpose()) / 2.0;
        for (i, a) in points.iter().enumerate() {
            for (j, b) in points.iter().enumerate() {
                let squared = (a - b).norm_squared();
                let expected = 0.09 * (-squared / 0.08).exp() + 0.01 * (-squared / 0.02).exp();
                assert!(
                    (found[(i, j)] - expected).abs() < 2e-5,
                    "{} {expected}",
                    found[(i, j)]
                );
            }
        }
    }

    #[test]
    fn odd_modes_vanish_on_the_plane_of_symmetry() {
        let scales = [FieldScale {
            amplitude: 1.0,
            length: 0.2,
        }];
        let found = field_modes(&[V3::new(0.0, 0.5, 0.0)], &line(), &scales, 10);
        assert!(found.odd.amax() < 1e-12 && found.even.amax() > 0.1);
        assert!(found.even.ncols() == 10);
    }
}
