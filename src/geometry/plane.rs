//! Planes through points on a surface.

use super::{Matrix3, Vector3};

/// The least-squares plane through `points`: its unit normal, either way round, and the points' root mean square
/// distance from it.
pub fn tangent_plane(points: &[Vector3<f64>]) -> (Vector3<f64>, f64) {
    let count = points.len().max(1) as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / count;
    let scatter: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let variance = eigen.eigenvalues[least].max(0.0) / count;
    (eigen.eigenvectors.column(least).normalize(), variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

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
