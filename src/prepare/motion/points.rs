//! Points from where several frames see them.

use crate::geometry::{Pose, Vector3};
use nalgebra::{Matrix3, Vector2};

/// The point nearest to all rays, and the largest angle between two of them in radians. `rays` are seen by cameras
/// `camera_from_input`, x and y on the plane z = 1. `None` where the rays are parallel or meet behind a camera.
pub fn triangulated(seen: &[(Pose, Vector2<f64>)]) -> Option<(Vector3<f64>, f64)> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let mut directions = Vec::with_capacity(seen.len());
    for (camera_from_input, ray) in seen {
        let input_from_camera = camera_from_input.inverse();
        let direction = (input_from_camera.rotation * Vector3::new(ray.x, ray.y, 1.0)).normalize();
        let across = Matrix3::identity() - direction * direction.transpose();
        normal += across;
        right += across * input_from_camera.translation;
        directions.push(direction);
    }
    let point = normal.try_inverse()? * right;
    let in_front = |(camera, _): &(Pose, _)| camera.transform(&point).z > 0.0;
    let all_finite = point.iter().all(|x| x.is_finite());
    if !all_finite || !seen.iter().all(in_front) {
        return None;
    }
    let mut angle = 0.0f64;
    for (i, a) in directions.iter().enumerate() {
        for b in &directions[..i] {
            angle = angle.max(a.cross(b).norm().atan2(a.dot(b)));
        }
    }
    Some((point, angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rotation3;

    fn camera(turn: f64) -> Pose {
        Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.0, turn, 0.0)),
            translation: Vector3::new(0.1, 0.0, 3.0),
        }
    }

    #[test]
    fn a_point_is_where_its_rays_meet() {
        let point = Vector3::new(0.3, -0.2, 0.4);
        let seen = [0.0, 0.2, 0.5].map(|turn| {
            let p = camera(turn).transform(&point);
            (camera(turn), Vector2::new(p.x / p.z, p.y / p.z))
        });
        let (found, angle) = triangulated(&seen).unwrap();
        assert!((found - point).norm() < 1e-12);
        assert!((0.3..0.6).contains(&angle), "{angle}");
        assert!(triangulated(&seen[..1]).is_none(), "one ray has no end");
        let behind = seen.map(|(camera, ray)| (camera, -ray));
        assert!(triangulated(&behind).is_none_or(|(found, _)| (found - point).norm() > 0.1));
    }
}
