//! The scene's light, which may turn and change its brightness over the sequence.

use super::super::render::{Light, LightFrame};
use crate::geometry::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

/// A [`Light`] and how it changes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lighting {
    /// The frame that `direction` is given in.
    pub fixed_to: LightFrame,
    /// Towards the light, in the frame that it is fixed to; any length but 0.
    pub direction: [f64; 3],
    /// The brightness of a surface that faces away from the light, as a share of its colour.
    pub ambient: f64,
    /// What the light adds where it falls straight onto the surface, as a share of its colour.
    pub diffuse: f64,
    /// Turn of `direction` in the first and the last frame about the vertical (y) axis of the frame that it is fixed to,
    /// clockwise as seen from above: the way azimuths grow.
    pub turn_deg: [f64; 2],
    /// Factor on `ambient` and `diffuse` in the first and the last frame. The backdrop has its own light.
    pub brightness: [f64; 2],
}

impl Default for Lighting {
    /// [`Light`]'s own default, steady.
    fn default() -> Self {
        let light = Light::default();
        Self {
            fixed_to: light.fixed_to,
            direction: light.direction,
            ambient: light.ambient,
            diffuse: light.diffuse,
            turn_deg: [0.0; 2],
            brightness: [1.0; 2],
        }
    }
}

impl Lighting {
    /// The light at `share` of the way from the first frame (0) to the last (1).
    pub(super) fn at(&self, share: f64) -> Light {
        let between = |[first, last]: [f64; 2]| first + share * (last - first);
        let down = match self.fixed_to {
            LightFrame::Object => -Vector3::y_axis(),
            LightFrame::Camera => Vector3::y_axis(),
        };
        let turn = Rotation3::from_axis_angle(&down, between(self.turn_deg).to_radians());
        let brightness = between(self.brightness);
        Light {
            fixed_to: self.fixed_to,
            direction: (turn * Vector3::from(self.direction)).into(),
            ambient: self.ambient * brightness,
            diffuse: self.diffuse * brightness,
        }
    }
}
