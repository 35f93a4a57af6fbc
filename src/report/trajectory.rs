//! Cameras as a TUM trajectory, which `evo` and its like read.

use crate::geometry::{Pose, UnitQuaternion};
use std::fmt::Write;

/// `t tx ty tz qx qy qz qw` a line, `world_from_camera` (world = object frame). `times_s` is used where every
/// frame has one, else t is the frame's index.
pub(super) fn tum(camera_from_object: &[Pose], times_s: &[Option<f64>]) -> String {
    let times: Option<Vec<f64>> = times_s.iter().copied().collect();
    let mut text = String::from(
        "# t tx ty tz qx qy qz qw: world_from_camera, world = object frame (+Y up, -Z front, diagonal 1)\n\
         # camera axes: x right, y down, z forward (OpenCV, COLMAP); t: ",
    );
    text.push_str(if times.is_some() {
        "seconds\n"
    } else {
        "frame index\n"
    });
    for (i, pose) in camera_from_object.iter().enumerate() {
        let world_from_camera = pose.inverse();
        let (t, q) = (world_from_camera.translation, quaternion(&world_from_camera));
        let time = times.as_ref().map_or(i as f64, |times| times[i]);
        let [w, x, y, z] = q;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{time} {} {} {} {x} {y} {z} {w}", t.x, t.y, t.z);
    }
    text
}

/// The quaternion (w, x, y, z) of a pose's rotation, w ≥ 0.
pub(super) fn quaternion(pose: &Pose) -> [f64; 4] {
    let q = UnitQuaternion::from_rotation_matrix(&pose.rotation);
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.i, q.j, q.k].map(|part| sign * part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};

    #[test]
    fn the_line_is_world_from_camera() {
        // The camera sits at (0, 0, 5) in the object frame, turned by 90° about its y axis.
        let world_from_camera = Pose {
            rotation: Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2),
            translation: Vector3::new(0.0, 0.0, 5.0),
        };
        let text = tum(&[world_from_camera.inverse()], &[Some(2.5)]);
        let line = text.lines().find(|line| !line.starts_with('#')).unwrap();
        let values: Vec<f64> = line.split(' ').map(|value| value.parse().unwrap()).collect();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (value, expected) in values.iter().zip([2.5, 0.0, 0.0, 5.0, 0.0, half, 0.0, half]) {
            assert!((value - expected).abs() < 1e-12, "{line}");
        }
    }

    #[test]
    fn without_every_time_the_index_stands() {
        let text = tum(&[Pose::identity(); 2], &[Some(7.0), None]);
        assert!(text.contains("frame index"));
        assert!(text.lines().last().unwrap().starts_with("1 "));
    }
}
