//! Cameras around the object.

use crate::geometry::{Matrix3, Pose, Rotation3, Vector3};

/// `camera_from_object` of a camera at `distance` from the object's centre that looks at it, with the object's +Y up
/// in the picture. Azimuth 0° looks at the front (from −Z), 90° at the object's right side (from +X); positive
/// elevations look down.
pub fn orbit(azimuth_deg: f64, elevation_deg: f64, distance: f64) -> Pose {
    let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    let centre = Vector3::new(
        azimuth.sin() * elevation.cos(),
        elevation.sin(),
        -azimuth.cos() * elevation.cos(),
    );
    let forward = -centre;
    // The derivative of `centre` by azimuth, reversed: right of a camera that looks at the centre, at the poles too.
    let right = Vector3::new(-azimuth.cos(), 0.0, -azimuth.sin());
    let down = forward.cross(&right);
    let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    Pose {
        rotation: Rotation3::from_matrix_unchecked(rotation),
        translation: Vector3::new(0.0, 0.0, distance),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_stands_where_azimuth_and_elevation_say() {
        let front = orbit(0.0, 0.0, 2.0);
        assert!((front.center() - Vector3::new(0.0, 0.0, -2.0)).norm() < 1e-12);
        let right = orbit(90.0, 0.0, 2.0);
        assert!((right.center() - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-12);
        let above = orbit(30.0, 40.0, 2.0);
        assert!((above.center().y - 2.0 * 40f64.to_radians().sin()).abs() < 1e-12);
    }

    #[test]
    fn up_is_up_and_nothing_is_mirrored() {
        for (azimuth, elevation) in [(0.0, 0.0), (35.0, 20.0), (-145.0, 60.0), (90.0, 89.9)] {
            let pose = orbit(azimuth, elevation, 2.0);
            assert!((pose.rotation.matrix().determinant() - 1.0).abs() < 1e-12);
            assert!(pose.transform(&Vector3::y()).y < 0.0);
            assert!((pose.transform(&Vector3::zeros()) - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
        }
        // Seen from the front, the object's right side is on the picture's left.
        assert!(orbit(0.0, 0.0, 2.0).transform(&Vector3::x()).x < 0.0);
    }
}
