//! Reads an input completely and says what is in it and everything that is wrong with it.

use super::assemble::{Parts, assemble};
use super::draft::Draft;
use super::{LoadOptions, Sequence, SequenceError, Truth, colmap, folder, openmvs};
use crate::geometry::Pinhole;
use rayon::prelude::*;
use std::path::Path;

/// What an input holds.
#[derive(Debug)]
pub struct Examination {
    pub name: String,
    /// `sequence folder`, `COLMAP workspace` …
    pub kind: &'static str,
    pub frames: Vec<FrameExamination>,
    /// What a user should know but need not mend.
    pub notes: Vec<String>,
    /// Every fault found; empty if and only if the input is usable.
    pub problems: Vec<SequenceError>,
    /// What could be read; complete if and only if there are no problems.
    sequence: Sequence,
}

impl Examination {
    /// The input itself, or the first of its faults.
    pub fn into_sequence(self) -> Result<Sequence, SequenceError> {
        match self.problems.into_iter().next() {
            None => Ok(self.sequence),
            Some(problem) => Err(problem),
        }
    }
}

/// What one frame holds; `None` where it could not be read.
#[derive(Clone, Debug)]
pub struct FrameExamination {
    pub name: String,
    pub camera: Pinhole,
    /// The image's (width, height).
    pub size: Option<(usize, usize)>,
    pub mask: Option<MaskSummary>,
    /// Share of the mask's pixels with off-the-shelf depth, in \[0, 1\].
    pub depth_share: Option<f64>,
    pub has_pose: bool,
    pub timestamp_s: Option<f64>,
}

/// Shape of one mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskSummary {
    /// Object pixels over all pixels, in \[0, 1\].
    pub share: f64,
    /// Object pixels in the image's outermost rows and columns.
    pub border_px: usize,
    /// 8-connected parts.
    pub parts: usize,
}

/// Reads `input`; see [`super::load`] for what it may be. An `Err` means that nothing could be said about frames.
pub fn examine(input: &Path, options: &LoadOptions) -> Result<Examination, SequenceError> {
    let draft = draft(input, options)?;
    let Draft {
        name,
        kind,
        listing,
        frames,
        motion_deviation,
        focal_deviation,
        truth_shape,
        mut notes,
        mut problems,
    } = draft;
    let frames = options.window.select(frames);
    if frames.len() < 2 && problems.is_empty() {
        problems.push(SequenceError::TooFewFrames {
            file: listing,
            count: frames.len(),
            mend: "add frames or widen --frames and --every".into(),
        });
    }
    let parts: Vec<Parts> = frames.into_par_iter().map(assemble).collect();
    let summaries: Vec<_> = parts.iter().map(summarise).collect();
    let mut kept = Vec::with_capacity(parts.len());
    for mut part in parts {
        notes.append(&mut part.notes);
        problems.append(&mut part.problems);
        kept.extend(part.into_frame());
    }
    let (frames, truths): (Vec<_>, Vec<_>) = kept.into_iter().unzip();
    let truth = truth_shape.map(|shape| {
        let (camera_from_object, depth) = truths.into_iter().flatten().unzip();
        Truth {
            camera_from_object,
            depth,
            shape,
        }
    });
    let sequence = Sequence {
        name: name.clone(),
        frames,
        motion_deviation,
        focal_deviation,
        truth,
    };
    Ok(Examination {
        name,
        kind,
        frames: summaries,
        notes,
        problems,
        sequence,
    })
}

/// Whether an input is of a kind that [`examine`] knows.
pub fn recognises(input: &Path) -> bool {
    input.join(folder::MANIFEST).is_file() || colmap::recognises(input) || openmvs::recognises(input)
}

fn draft(input: &Path, options: &LoadOptions) -> Result<Draft, SequenceError> {
    if input.join(folder::MANIFEST).is_file() {
        if let Some(depth) = &options.depth {
            return Err(SequenceError::invalid(
                depth,
                "--depth",
                "a sequence folder names its own depth",
                "leave --depth out, or import the COLMAP workspace with it",
            ));
        }
        return folder::draft(input);
    }
    if colmap::recognises(input) {
        return colmap::draft(input, options.depth.as_deref());
    }
    if openmvs::recognises(input) {
        return openmvs::draft(input);
    }
    Err(SequenceError::NotRecognised(input.to_owned()))
}

fn summarise(parts: &Parts) -> FrameExamination {
    let depth_share = parts
        .mask
        .as_ref()
        .zip(parts.depth.as_ref())
        .map(|(mask, depth)| {
            let (mut object, mut known) = (0usize, 0usize);
            for (&inside, &z) in mask.data().iter().zip(depth.data()) {
                object += usize::from(inside);
                known += usize::from(inside && z > 0.0);
            }
            known as f64 / object.max(1) as f64
        });
    FrameExamination {
        name: parts.draft.name.clone(),
        camera: parts.draft.camera,
        size: parts.image.as_ref().map(|image| image.size()),
        mask: parts.mask.as_ref().map(|mask| MaskSummary {
            share: mask.share(),
            border_px: mask.border_count(),
            parts: mask.part_count(),
        }),
        depth_share,
        has_pose: parts.draft.camera_from_input.is_some(),
        timestamp_s: parts.draft.timestamp_s,
    }
}
