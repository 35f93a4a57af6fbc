//! What [`against_truth`](super::against_truth) judges: cameras, depth and shape, from a solve or from off-the-shelf
//! tools.

use super::align_to_truth;
use crate::geometry::{Pose, Vector3};
use crate::image::DepthMap;
use crate::init::Estimate;
use crate::report::Surface;
use crate::sequence::{Frame, Sequence, same_frame};

/// What is to be judged, frame by frame in the truth's order, in the object frame.
pub struct Estimated {
    /// The frame's name, its index in the truth, `camera_from_object`.
    pub frames: Vec<(String, usize, Pose)>,
    /// The depth map of each entry of `frames`; `None` where it has none.
    pub depth: Vec<Option<DepthMap>>,
    /// Brings `depth` into object units.
    pub depth_scale: f64,
    /// Whether `depth` covers the whole silhouette, so that its outline means something.
    pub dense: bool,
    /// Points of the canonical shape, if there is one.
    pub shape: Option<Vec<Vector3<f64>>>,
}

impl Estimated {
    /// An estimate for the frames of `sequence`, in their order; `surface` is its shape.
    pub fn of_estimate(sequence: &Sequence, surface: &Surface, estimate: &Estimate) -> Self {
        let numbered = || sequence.frames.iter().enumerate();
        Self {
            frames: numbered()
                .map(|(l, frame)| (frame.name.clone(), l, estimate.camera_from_object[l]))
                .collect(),
            depth: numbered()
                .map(|(l, frame)| {
                    let pose = estimate.camera_from_object[l];
                    Some(surface.render(&frame.camera, &pose, frame.image.size()).depth)
                })
                .collect(),
            depth_scale: 1.0,
            dense: true,
            shape: Some(surface.points().to_vec()),
        }
    }

    /// The off-the-shelf poses and depth of those frames of `own` that `reference` has the truth of and `keep` keeps,
    /// aligned with the truth by frame 0 and scale (Sec. 3.2). `None` if they cannot be aligned.
    pub fn of_input(own: &Sequence, reference: &Sequence, keep: impl Fn(&str) -> bool) -> Option<Self> {
        let truth = reference.truth.as_ref()?;
        let known = |frame: &Frame| {
            let mut others = reference.frames.iter();
            others.position(|other| same_frame(&other.name, &frame.name))
        };
        let chosen: Vec<(&Frame, usize)> = own
            .frames
            .iter()
            .filter(|frame| keep(&frame.name))
            .filter_map(|frame| Some((frame, known(frame)?)))
            .collect();
        let true_poses: Vec<_> = chosen
            .iter()
            .filter_map(|&(_, index)| truth.camera_from_object.get(index).copied())
            .collect();
        let own_poses: Vec<_> = chosen.iter().map(|(frame, _)| frame.camera_from_input).collect();
        let (aligned, alpha) = align_to_truth(&own_poses, &true_poses)?;
        let (mut frames, mut depth) = (Vec::new(), Vec::new());
        for ((frame, index), pose) in chosen.into_iter().zip(aligned) {
            if let Some(pose) = pose {
                frames.push((frame.name.clone(), index, pose));
                depth.push(frame.depth.clone());
            }
        }
        Some(Self {
            frames,
            depth,
            depth_scale: alpha,
            dense: false,
            shape: None,
        })
    }
}
