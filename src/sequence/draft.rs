//! What every reader produces: which files make up each frame, before a pixel is read.

use super::distortion::Distortion;
use super::error::SequenceError;
use crate::geometry::{Pinhole, Pose, Vector3};
use std::path::{Path, PathBuf};

/// The frames of an input in order, and what its reader noticed on the way.
pub(super) struct Draft {
    pub name: String,
    /// What kind of input it is, for people.
    pub kind: &'static str,
    /// The file that lists the frames, for messages about the list as a whole.
    pub listing: PathBuf,
    pub frames: Vec<FrameDraft>,
    /// How well the poses are known, where the input says so.
    pub motion_deviation: Option<f64>,
    /// How well the focal lengths are known, likewise.
    pub focal_deviation: Option<f64>,
    /// Points of the true shape; with it, every frame has a truth of its own.
    pub truth_shape: Option<Vec<[f32; 3]>>,
    pub notes: Vec<String>,
    pub problems: Vec<SequenceError>,
}

pub(super) struct FrameDraft {
    pub name: String,
    /// The file that declares the camera, for messages.
    pub declared_in: PathBuf,
    pub image: PathBuf,
    pub mask: PathBuf,
    pub camera: Pinhole,
    pub distortion: Distortion,
    /// Image size that the camera was calibrated for, where the input says so: (width, height).
    pub calibrated_size: Option<(usize, usize)>,
    pub timestamp_s: Option<f64>,
    pub camera_from_input: Option<Pose>,
    pub depth: Option<DenseDepth>,
    /// Reconstructed points seen by this frame, in its camera frame: semi-dense depth where there is none else.
    pub points: Vec<Vector3<f64>>,
    /// EXR, of the image's size.
    pub depth_deviation: Option<PathBuf>,
    pub truth: Option<FrameTruth>,
}

/// A file with depth per pixel.
pub(super) enum DenseDepth {
    /// `depth/*.exr`, of the image's size.
    Exr(PathBuf),
    /// COLMAP's `stereo/depth_maps/*.geometric.bin`.
    ColmapMap(PathBuf),
    /// openMVS's `depth*.dmap`, whose camera the reader has checked.
    OpenMvsMap(PathBuf),
}

pub(super) struct FrameTruth {
    pub camera_from_object: Pose,
    /// EXR, z in object units.
    pub depth: PathBuf,
}

/// What a sequence is called: its folder's own name, whatever way it was reached.
pub(super) fn folder_name(folder: &Path) -> String {
    let full = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    full.file_name()
        .map_or_else(|| "sequence".into(), |name| name.to_string_lossy().into_owned())
}
