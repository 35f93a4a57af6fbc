//! The start of the optimisation (Sec. 2.4): style, pose hypotheses from silhouettes, scale and motion.

mod cloud;
mod hypotheses;
mod initialise;
mod motion;
mod placement;
mod scale;
mod silhouette;
mod templates;
#[cfg(test)]
mod testing;

pub use hypotheses::{HypothesisOptions, PoseHypothesis, pose_hypotheses};
pub use initialise::{InitError, InitOptions, Initialisation, initialise, initialise_at};
pub use motion::cameras_from_input;
pub use scale::scale_from_inverse_depth;
pub use templates::TemplateGrid;

use crate::geometry::{Pinhole, Pose};
use serde::{Deserialize, Serialize};

/// Every variable of the problem: what initialisation hands to the solver, and what the solver refines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// p_l: one per frame of the sequence, in its order.
    pub camera_from_object: Vec<Pose>,
    /// s, S entries.
    pub style: Vec<f64>,
    /// α: x_cam = α x'_cam (Eq. 10).
    pub alpha: f64,
    /// By which all focal lengths are multiplied; 1 unless the solver was asked to find it.
    pub focal_factor: f64,
}

impl Estimate {
    /// L.
    pub fn frame_count(&self) -> usize {
        self.camera_from_object.len()
    }

    /// A frame's camera with the focal factor.
    pub fn camera(&self, camera: &Pinhole) -> Pinhole {
        Pinhole {
            fx: self.focal_factor * camera.fx,
            fy: self.focal_factor * camera.fy,
            ..*camera
        }
    }
}
