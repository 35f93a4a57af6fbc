//! Camera motion relative to the object, from features on the object alone: the background may move with the camera or stay.
//!
//! Features and matches are OpenCV's; two views start a reconstruction, further frames are added one by one, and Ceres adjusts all.

mod alike;
mod focal;
mod grow;
mod matching;
mod points;
mod start;
mod tracks;

pub use matching::{Matching, match_features, object_size};

use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::{Mask, RgbImage};
pub use focal::{FREE, FocalEvidence};
use start::reconstruct;

/// Options of the search for the camera's motion.
#[derive(Clone, Debug)]
pub struct MotionOptions {
    /// A feature may be so far from where a pose sees it, in pixels of an object whose mask is 500 pixels across.
    pub error_px: f64,
    /// How well the focal length is known: the standard deviation of its logarithm; 0 keeps it, [`FREE`] says that nothing
    /// is known of it, so that features move it and usual lenses count beside them.
    pub focal_deviation: f64,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            error_px: 3.0,
            focal_deviation: 0.0,
        }
    }
}

/// A picture and what belongs to the object in it.
pub struct MaskedImage<'a> {
    pub image: &'a RgbImage,
    pub mask: &'a Mask,
}

/// Poses of the frames that could be placed, and the features' points, in the units of the first pair's baseline.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Motion {
    /// The intrinsics of every frame, with fx and fy as adjusted.
    pub camera: Pinhole,
    /// The pose of every frame; `None` where it could not be placed.
    pub camera_from_input: Vec<Option<Pose>>,
    pub points: Vec<Vector3<f64>>,
    /// The indices of the frames that see each point.
    pub seen_in: Vec<Vec<u32>>,
    /// How well the camera's focal length is known by all evidence: the standard deviation of its logarithm; 0 where it was kept.
    pub focal_deviation: f64,
    /// What the features alone say of fx.
    pub focal_by_features: FocalEvidence,
    /// Root mean square over all observations.
    pub error_px: f64,
    /// Whether features fit nearly as well with near and far swapped and every turn reversed.
    pub may_be_swapped: bool,
}

impl Motion {
    /// By which motions are compared.
    pub fn score(&self) -> f64 {
        score(self.seen_in.iter().map(Vec::len).sum(), self.error_px)
    }

    /// Whether all frames are placed.
    pub fn is_whole(&self) -> bool {
        self.camera_from_input.iter().all(Option::is_some)
    }
}

/// The number of observations over 0.5 + the reprojection error in pixels.
fn score(observations: usize, error_px: f64) -> f64 {
    observations as f64 / (0.5 + error_px)
}

/// Why there is no motion.
#[derive(Debug, thiserror::Error)]
pub enum StructureFromMotionError {
    /// No two frames have enough features in common.
    #[error(
        "frames: features on the object match between too few of them ({matched} matches in the best pair); take sharper, larger or more pictures, closer in time"
    )]
    NoPair {
        /// The matches of the best pair.
        matched: usize,
    },
    /// The caller stopped the work.
    #[error("interrupted")]
    Interrupted,
    /// OpenCV or Ceres threw an exception. The field is its message.
    #[error("OpenCV or Ceres: {0}")]
    Library(String),
}

impl From<cxx::Exception> for StructureFromMotionError {
    fn from(error: cxx::Exception) -> Self {
        Self::Library(crate::image::one_line(error.what()))
    }
}

/// The motion that matched features tell of. `camera` is what is known of the camera.
///
/// # Errors
/// No two frames have enough features in common, OpenCV or Ceres fails, or the caller stops the work.
pub fn motion(
    matching: &Matching,
    camera: &Pinhole,
    options: &MotionOptions,
) -> Result<Motion, StructureFromMotionError> {
    reconstruct(matching, camera, options)
}
