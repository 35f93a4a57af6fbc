//! The input: frames of one object with masks, intrinsics and what off-the-shelf tools made of them.

use crate::geometry::{Pinhole, Pose};
use crate::image::{DepthMap, Mask, RgbImage};

/// Frames in order; frame 0 is the target frame of Eq. 4.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// The folder's name.
    pub name: String,
    pub frames: Vec<Frame>,
    /// Known only for sequences that were rendered; never read by the solver.
    pub truth: Option<Truth>,
}

/// One undistorted frame. Image, mask and depth have one size.
#[derive(Clone, Debug)]
pub struct Frame {
    pub name: String,
    pub image: RgbImage,
    pub mask: Mask,
    pub camera: Pinhole,
    pub timestamp_s: Option<f64>,
    /// x_cam' = R' x' + t' in the off-the-shelf reconstruction's own frame and units (Eq. 10).
    pub camera_from_input: Option<Pose>,
    /// Off-the-shelf z in the same units, 0 = unknown; counts inside the mask only.
    pub depth: Option<DepthMap>,
}

/// What a rendered sequence knows of itself.
#[derive(Clone, Debug)]
pub struct Truth {
    /// One per frame.
    pub camera_from_object: Vec<Pose>,
    /// z in object units, one per frame.
    pub depth: Vec<DepthMap>,
    /// Points on the outside of the canonical shape, object frame.
    pub shape: Vec<[f32; 3]>,
}
