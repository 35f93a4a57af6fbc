//! Planes through points on a surface.

use super::{Matrix3, Vector3};

/// The least-squares plane through `points`: its unit normal, either way round, and the points' root mean square
/// distance from it.
pub fn tangent_plane(points: &[Vector3<f64>]) -> (Vector3<f64>, f64) {
    let count = points.len().max(1) as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / count;
    let mut scatter = Matrix3::zeros();
    for point in points {
        let offset = point - mean;
        scatter += offset * offset.transpose();
    }
    let normal = isolated_least_direction(&scatter).unwrap_or_else(|| {
        let eigen = scatter.symmetric_eigen();
        eigen.eigenvectors.column(eigen.eigenvalues.imin()).normalize()
    });
    let variance = points
        .iter()
        .map(|p| normal.dot(&(p - mean)).powi(2))
        .sum::<f64>()
        / count;
    (normal, variance.sqrt())
}

/// The unit eigenvector of a symmetric matrix's lowest eigenvalue, in closed form (several times as fast as by rotations);
/// `None` where that eigenvalue is not clearly apart from the middle one.
fn isolated_least_direction(matrix: &Matrix3<f64>) -> Option<Vector3<f64>> {
    // Eigenvalues are mean + 2 spread cos(φ + 2π k / 3), cos 3φ = skew: at a skew of 1 the lower two coincide.
    const HIGHEST_SKEW: f64 = 0.9;
    let mean = matrix.trace() / 3.0;
    let centred = matrix - Matrix3::identity() * mean;
    let spread = (centred.norm_squared() / 6.0).sqrt();
    let skew = (centred / spread).determinant() / 2.0;
    // Not so either where the matrix is a multiple of the identity and the skew no number.
    if skew.is_nan() || skew >= HIGHEST_SKEW {
        return None;
    }
    let lowest = 2.0 * spread * (skew.max(-1.0).acos() / 3.0 + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    // All rows of this matrix are normal to the eigenvector, and two of them at least are not parallel.
    let rows = centred - Matrix3::identity() * lowest;
    let [a, b, c] = [0, 1, 2].map(|row| rows.column(row).into_owned());
    let normals = [a.cross(&b), b.cross(&c), c.cross(&a)];
    let longest = normals
        .into_iter()
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    Some(longest.normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rotation3;
    use proptest::prelude::*;

    proptest! {
        /// Scatters of any shape, turned anyhow: needles, discs and balls among them.
        #[test]
        fn the_closed_form_is_the_least_eigenvector(
            omega in proptest::array::uniform3(-3.0..3.0f64),
            spreads in proptest::array::uniform3(-12..1i32),
        ) {
            let turn = Rotation3::from_scaled_axis(Vector3::from(omega)).into_inner();
            let diagonal = Matrix3::from_diagonal(&Vector3::from(spreads.map(|x| 2.0f64.powi(x))));
            let matrix = turn * diagonal * turn.transpose();
            let lowest = diagonal.diagonal().min();
            if let Some(direction) = isolated_least_direction(&matrix) {
                prop_assert!((direction.norm() - 1.0).abs() < 1e-12);
                // Of the largest eigenvalue, at most 1.
                prop_assert!((matrix * direction - lowest * direction).norm() < 1e-13);
            }
        }
    }

    #[test]
    fn points_on_a_line_or_in_one_place_have_some_plane() {
        let line: Vec<Vector3<f64>> = (0..8)
            .map(|i| Vector3::new(1.0, 2.0, -1.0) * f64::from(i))
            .collect();
        let (normal, distance) = tangent_plane(&line);
        assert!(
            (normal.norm() - 1.0).abs() < 1e-12 && distance < 1e-7,
            "{normal} {distance}"
        );
        let (normal, distance) = tangent_plane(&[Vector3::new(1.0, 2.0, 3.0); 5]);
        assert!(
            (normal.norm() - 1.0).abs() < 1e-12 && distance < 1e-12,
            "{normal} {distance}"
        );
    }

    #[test]
    fn four_corners_and_their_lift() {
        // ±0.1 off the plane x + y = 0, alternately.
        let along = Vector3::new(1.0, -1.0, 0.0).normalize();
        let across = Vector3::new(1.0, 1.0, 0.0).normalize();
        let corner = |u: f64, v: f64, lift: f64| u * along + v * Vector3::z() + lift * across;
        let points = [
            corner(1.0, 1.0, 0.1),
            corner(-1.0, 1.0, -0.1),
            corner(-1.0, -1.0, 0.1),
            corner(1.0, -1.0, -0.1),
        ];
        let (normal, distance) = tangent_plane(&points);
        assert!((normal.dot(&across).abs() - 1.0).abs() < 1e-12);
        assert!((distance - 0.1).abs() < 1e-12);
    }
}
