//! The directions from which templates are rendered (Sec. 2.4).
//!
//! **Azimuth** 0 looks at the object's front (its −Z side); it grows as the camera walks towards the object's
//! +X side (its own right-hand side): 90° sees the right flank, 180° the rear, 270° the left flank. **Elevation**
//! is positive above the object's horizontal plane. **Roll** turns the image clockwise.
//!
//! The angles describe the ray to the object rather than the optical axis, so that an object off the image's
//! centre looks the same as one in it.

use crate::geometry::{Matrix3, Pose, Rotation3, Vector3};

/// A viewing direction from the camera to the object, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Template {
    pub azimuth_deg: f64,
    pub elevation_deg: f64,
    pub roll_deg: f64,
}

/// The grid of templates, degrees.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TemplateGrid {
    /// The step between azimuths, from 0 to 360, degrees.
    pub azimuth_step_deg: f64,
    /// The elevations, degrees.
    pub elevations_deg: Vec<f64>,
    /// The rolls, degrees.
    pub rolls_deg: Vec<f64>,
}

impl Default for TemplateGrid {
    fn default() -> Self {
        Self {
            azimuth_step_deg: 10.0,
            elevations_deg: vec![-10.0, 0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0],
            rolls_deg: vec![-10.0, 0.0, 10.0],
        }
    }
}

impl TemplateGrid {
    /// Every template, in a fixed order.
    pub(super) fn templates(&self) -> Vec<Template> {
        let count = (360.0 / self.azimuth_step_deg).ceil() as usize;
        let mut templates = Vec::new();
        for &roll_deg in &self.rolls_deg {
            for &elevation_deg in &self.elevations_deg {
                templates.extend((0..count).map(|i| Template {
                    azimuth_deg: i as f64 * self.azimuth_step_deg,
                    elevation_deg,
                    roll_deg,
                }));
            }
        }
        templates
    }
}

impl Template {
    /// `camera_from_object`'s rotation for an object seen along `ray` (camera frame, z > 0).
    pub fn rotation(&self, ray: &Vector3<f64>) -> Rotation3<f64> {
        let (azimuth, elevation) = (self.azimuth_deg.to_radians(), self.elevation_deg.to_radians());
        let (sin_a, cos_a) = azimuth.sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let to_camera = Vector3::new(sin_a * cos_e, sin_e, -cos_a * cos_e);
        // forward × up, written out so that it also holds looking straight down.
        let right = Vector3::new(-cos_a, 0.0, -sin_a);
        let down = -to_camera.cross(&right);
        let look = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[
            right.transpose(),
            down.transpose(),
            -to_camera.transpose(),
        ]));
        let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), self.roll_deg.to_radians());
        // A ray with z > 0 is never opposite to the optical axis.
        let ray_from_axis = Rotation3::rotation_between(&Vector3::z(), ray).unwrap_or_default();
        ray_from_axis * roll * look
    }

    /// The direction that `camera_from_object` sees the object's centre from: the inverse of [`Self::rotation`].
    pub fn of(camera_from_object: &Pose) -> Self {
        let centre = camera_from_object.center();
        let straight = Self {
            azimuth_deg: centre.x.atan2(-centre.z).to_degrees().rem_euclid(360.0),
            elevation_deg: centre.y.atan2(centre.x.hypot(centre.z)).to_degrees(),
            roll_deg: 0.0,
        };
        let ray = &camera_from_object.translation;
        let axis_from_ray = Rotation3::rotation_between(ray, &Vector3::z()).unwrap_or_default();
        let roll = axis_from_ray * camera_from_object.rotation * straight.rotation(&Vector3::z()).inverse();
        Self {
            roll_deg: roll.scaled_axis().z.to_degrees(),
            ..straight
        }
    }

    /// Seen from the opposite side: for most silhouettes front and rear are nearly the same.
    pub fn mirrored(&self) -> Self {
        Self {
            azimuth_deg: (self.azimuth_deg + 180.0) % 360.0,
            ..*self
        }
    }

    /// The templates one step away along each angle.
    pub fn neighbours(&self, step_deg: f64) -> [Self; 6] {
        let moved = |azimuth: f64, elevation: f64, roll: f64| Self {
            azimuth_deg: (self.azimuth_deg + azimuth).rem_euclid(360.0),
            elevation_deg: (self.elevation_deg + elevation).clamp(-90.0, 90.0),
            roll_deg: self.roll_deg + roll,
        };
        [
            moved(step_deg, 0.0, 0.0),
            moved(-step_deg, 0.0, 0.0),
            moved(0.0, step_deg, 0.0),
            moved(0.0, -step_deg, 0.0),
            moved(0.0, 0.0, step_deg),
            moved(0.0, 0.0, -step_deg),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AHEAD: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);

    fn template(azimuth_deg: f64, elevation_deg: f64, roll_deg: f64) -> Template {
        Template {
            azimuth_deg,
            elevation_deg,
            roll_deg,
        }
    }

    fn close(a: Vector3<f64>, b: Vector3<f64>) -> bool {
        (a - b).norm() < 1e-12
    }

    #[test]
    fn azimuth_zero_faces_the_front() {
        let rotation = template(0.0, 0.0, 0.0).rotation(&AHEAD);
        // The front is nearer than the rear, up is up, and the object's right hand is on the image's left.
        assert!(close(rotation * -Vector3::z(), -Vector3::z()));
        assert!(close(rotation * Vector3::y(), -Vector3::y()));
        assert!(close(rotation * Vector3::x(), -Vector3::x()));
    }

    #[test]
    fn azimuth_ninety_faces_the_right_flank_with_the_nose_to_the_right() {
        let rotation = template(90.0, 0.0, 0.0).rotation(&AHEAD);
        assert!(close(rotation * Vector3::x(), -Vector3::z()));
        assert!(close(rotation * -Vector3::z(), Vector3::x()));
    }

    #[test]
    fn elevation_looks_down_on_the_roof() {
        let rotation = template(30.0, 90.0, 0.0).rotation(&AHEAD);
        assert!(close(rotation * Vector3::y(), -Vector3::z()));
    }

    #[test]
    fn roll_turns_the_image_clockwise() {
        let rotation = template(0.0, 0.0, 90.0).rotation(&AHEAD);
        assert!(close(rotation * Vector3::y(), Vector3::x()));
    }

    #[test]
    fn the_default_grid_has_864_templates() {
        assert_eq!(TemplateGrid::default().templates().len(), 36 * 8 * 3);
    }

    proptest! {
        #[test]
        fn rotations_are_proper(a in 0.0..360.0f64, e in -90.0..90.0f64, r in -180.0..180.0f64) {
            let matrix = template(a, e, r).rotation(&Vector3::new(0.3, -0.2, 1.0)).into_inner();
            prop_assert!((matrix * matrix.transpose() - Matrix3::identity()).norm() < 1e-12);
            prop_assert!((matrix.determinant() - 1.0).abs() < 1e-12);
        }

        /// The direction from the object to the camera is that of the angles, wherever in the image it is.
        #[test]
        fn the_angles_are_those_of_the_ray(a in 0.0..360.0f64, e in -89.0..89.0f64, r in -30.0..30.0f64,
                                           x in -0.6..0.6f64, y in -0.6..0.6f64) {
            let ray = Vector3::new(x, y, 1.0).normalize();
            let to_camera = template(a, e, r).rotation(&ray).inverse() * -ray;
            prop_assert!((to_camera.y - e.to_radians().sin()).abs() < 1e-9);
            let azimuth = to_camera.x.atan2(-to_camera.z).to_degrees().rem_euclid(360.0);
            prop_assert!((azimuth - a).abs() < 1e-6);
        }
    }

    proptest! {
        #[test]
        fn a_pose_is_taken_for_the_template_that_made_it(
            azimuth in 0.0..360.0f64,
            elevation in -80.0..80.0f64,
            roll in -170.0..170.0f64,
            x in -1.0..1.0f64,
            y in -1.0..1.0f64,
        ) {
            let made = template(azimuth, elevation, roll);
            let ray = Vector3::new(x, y, 2.0);
            let found = Template::of(&Pose {
                rotation: made.rotation(&ray),
                translation: ray,
            });
            let turned = (found.azimuth_deg - azimuth).rem_euclid(360.0);
            prop_assert!(turned.min(360.0 - turned) < 1e-6, "{found:?}");
            prop_assert!((found.elevation_deg - elevation).abs() < 1e-6 && (found.roll_deg - roll).abs() < 1e-6, "{found:?}");
        }
    }
}
