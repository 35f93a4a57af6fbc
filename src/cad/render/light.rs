//! One distant light and an ambient part.

use crate::geometry::Pose;
use nalgebra::{Unit, Vector3};
use serde::{Deserialize, Serialize};

/// What the light's direction is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightFrame {
    /// Shading moves with the surface, so a point keeps its colour from frame to frame.
    Object,
    /// As when the object turns before a fixed camera: shading stays where it is while the surface moves.
    Camera,
}

/// Lambert: `ambient + diffuse · max(0, normal · direction)`, times the surface's colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    pub fixed_to: LightFrame,
    /// Towards the light, in the frame that it is fixed to; any length but 0.
    pub direction: [f64; 3],
    pub ambient: f64,
    pub diffuse: f64,
}

impl Default for Light {
    /// From above, in front and to the right of the object.
    fn default() -> Self {
        Self {
            fixed_to: LightFrame::Object,
            direction: [0.6, 1.0, -0.5],
            ambient: 0.45,
            diffuse: 0.6,
        }
    }
}

/// The light as one view sees it.
pub(in crate::cad) struct ObjectLight {
    pub(in crate::cad) direction: Unit<Vector3<f64>>,
    pub(in crate::cad) ambient: f64,
    pub(in crate::cad) diffuse: f64,
}

impl Light {
    pub(in crate::cad) fn in_object(&self, camera_from_object: &Pose) -> ObjectLight {
        let given = Vector3::from(self.direction);
        let direction = match self.fixed_to {
            LightFrame::Object => given,
            LightFrame::Camera => camera_from_object.rotation.inverse() * given,
        };
        ObjectLight {
            direction: Unit::new_normalize(direction),
            ambient: self.ambient,
            diffuse: self.diffuse,
        }
    }
}

impl ObjectLight {
    /// The factor on the surface's colour; `normal` points out of the surface.
    pub(super) fn intensity(&self, normal: &Vector3<f64>) -> f64 {
        self.ambient + self.diffuse * normal.dot(&self.direction).max(0.0)
    }
}
