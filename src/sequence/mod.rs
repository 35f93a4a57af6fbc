//! The input: frames of one object with masks, intrinsics and what off-the-shelf tools made of them.
//!
//! [`load`] reads every kind of input, [`examine`] also says what is in it and all that is wrong, [`write()`] makes
//! the folder described in [`folder`].

mod assemble;
mod bytes;
mod colmap;
mod content;
mod depth;
mod distortion;
mod draft;
mod error;
mod examine;
#[cfg(test)]
#[path = "../../tests/all/fixture/mod.rs"]
mod fixture;
pub mod folder;
mod openmvs;
mod options;
#[cfg(test)]
mod tests;
mod undistort;
mod validate;
mod workspace;

pub use content::{Sequence, SequenceContent};
pub use error::SequenceError;
pub use examine::{Examination, FrameExamination, MaskSummary, examine, recognises};
pub use folder::write;
pub use options::{FrameWindow, LoadOptions, WindowError};

use crate::geometry::{Pinhole, Pose};
use crate::image::{DepthMap, Grid, Mask, RgbImage};
use std::path::Path;
use std::sync::Arc;

impl Sequence {
    /// Takes over what `reference`, read from `folder`, knows of these frames, by their names: so that off-the-shelf tools
    /// that were run on rendered images can be judged. Fails unless it knows every frame, of the same size.
    pub fn with_truth_of(self, reference: &Self, folder: &Path) -> Result<Self, SequenceError> {
        let listing = folder.join(folder::MANIFEST);
        let known = reference.truth.as_ref().ok_or_else(|| SequenceError::Missing {
            file: listing.clone(),
            what: "[truth]".into(),
            mend: "name a rendered sequence".into(),
        })?;
        let (mut camera_from_object, mut depth) = (Vec::new(), Vec::new());
        for frame in &self.frames {
            let mut others = reference.frames.iter();
            let index = others
                .position(|other| same_frame(&other.name, &frame.name))
                .filter(|&index| known.depth[index].size() == frame.image.size())
                .ok_or_else(|| {
                    let (width, height) = frame.image.size();
                    SequenceError::Missing {
                        file: listing.clone(),
                        what: format!("truth of frame {}, {width} × {height}", frame.name),
                        mend: "name the sequence that the frames were rendered for".into(),
                    }
                })?;
            camera_from_object.push(known.camera_from_object[index]);
            depth.push(known.depth[index].clone());
        }
        let truth = Truth {
            camera_from_object,
            depth,
            shape: known.shape.clone(),
        };
        self.edited(|content| content.truth = Some(truth))
    }
}

/// Whether two names are of one frame: equal, or equal without an extension.
pub(crate) fn same_frame(a: &str, b: &str) -> bool {
    let stem = |name: &str| {
        name.rsplit_once('.')
            .map_or(name.to_owned(), |(stem, _)| stem.to_owned())
    };
    a == b || stem(a) == stem(b)
}

/// One undistorted frame. Image, mask and depth have one size.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The frame's name, once only in its sequence.
    pub name: String,
    /// Shared with whoever looks at it for long, as the solver.
    pub image: Arc<RgbImage>,
    /// True on the object.
    pub mask: Mask,
    /// The intrinsics, pixels.
    pub camera: Pinhole,
    /// The time at which the frame was taken, seconds; `None` where the input does not tell.
    pub timestamp_s: Option<f64>,
    /// x_cam' = R' x' + t' in the off-the-shelf reconstruction's own frame and units (Eq. 10).
    pub camera_from_input: Option<Pose>,
    /// Off-the-shelf z in the same units, 0 = unknown; counts inside the mask only.
    pub depth: Option<DepthMap>,
    /// Standard deviation of that depth as a share of it, 0 where it is not known: the larger, the less the depth weighs.
    pub depth_deviation: Option<Grid<f32>>,
}

/// The truth of a rendered sequence.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The true pose of every frame; lengths in diagonals.
    pub camera_from_object: Vec<Pose>,
    /// The true depth map of every frame, z in diagonals.
    pub depth: Vec<DepthMap>,
    /// Points on the outside of the canonical shape, object frame.
    pub shape: Vec<[f32; 3]>,
}

/// Reads one file of a reconstruction, told by its name: for the targets in `fuzz/`.
#[cfg(fuzzing)]
pub fn fuzz(name: &str, data: &[u8]) {
    match name {
        "scene.mvs" | "depth0000.dmap" => openmvs::fuzz(name, data),
        _ => colmap::fuzz(name, data),
    }
}

/// Reads a sequence folder, a COLMAP workspace (optionally with openMVS depth) or an openMVS project. The first
/// fault found is the error; what is merely worth knowing goes to the log.
pub fn load(input: &Path, options: &LoadOptions) -> Result<Sequence, SequenceError> {
    let examination = examine(input, options)?;
    for note in &examination.notes {
        tracing::info!("{}: {note}", input.display());
    }
    examination.into_sequence()
}
