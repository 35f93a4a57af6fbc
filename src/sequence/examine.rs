//! Reads an input completely and says what is in it and everything that is wrong with it.

use super::assemble::{Parts, assemble};
use super::depth::check_together;
use super::draft::{Draft, FrameDraft};
use super::{LoadOptions, Sequence, SequenceContent, SequenceError, Truth, colmap, folder, openmvs};
use crate::geometry::Pinhole;
use crate::image::{Mask, dimensions};
use crate::memory::memory_bytes;
use rayon::prelude::*;
use std::path::Path;

/// Of a solve: the image as floats, its pyramid and that of its derivatives, mask, distances and depth.
const BYTES_PER_PIXEL: f64 = 60.0;
/// Masks of more than half of the frames whose object lies along more than this share of the border are doubted.
const SUSPICIOUS_BORDER: f64 = 0.5;

/// What an input holds and what is wrong with it.
#[derive(Debug)]
pub struct Examination {
    /// The input's name.
    pub name: String,
    /// The kind of input: `sequence folder`, `COLMAP workspace` …
    pub kind: &'static str,
    /// One entry per frame, in order.
    pub frames: Vec<FrameExamination>,
    /// What a user should know but need not mend.
    pub notes: Vec<String>,
    /// Every fault found; empty if and only if the input is usable.
    pub problems: Vec<SequenceError>,
    /// The sequence itself; `None` if and only if there are problems.
    sequence: Option<Sequence>,
}

impl Examination {
    /// The sequence, or the first of the input's faults.
    pub fn into_sequence(self) -> Result<Sequence, SequenceError> {
        let fault = self.problems.into_iter().next();
        // Without problems there is a sequence.
        let missing = || fault.unwrap_or_else(|| SequenceError::NotRecognised(self.name.into()));
        self.sequence.ok_or_else(missing)
    }
}

/// What one frame holds; `None` where it could not be read.
#[derive(Clone, Debug)]
pub struct FrameExamination {
    /// The frame's name.
    pub name: String,
    /// The frame's intrinsics, pixels.
    pub camera: Pinhole,
    /// The image's (width, height).
    pub size: Option<(usize, usize)>,
    /// The shape of the mask; `None` where there is none that can be read.
    pub mask: Option<MaskSummary>,
    /// Share of the mask's pixels with off-the-shelf depth, in \[0, 1\].
    pub depth_share: Option<f64>,
    /// Whether the input gives the frame's pose.
    pub has_pose: bool,
    /// The time at which the frame was taken, seconds; `None` where the input does not tell.
    pub timestamp_s: Option<f64>,
}

/// Shape of one mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskSummary {
    /// Object pixels over all pixels, in \[0, 1\].
    pub share: f64,
    /// Object pixels in the image's outermost rows and columns.
    pub border_px: usize,
    /// The number of 8-connected parts.
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
            file: listing.clone(),
            count: frames.len(),
            mend: "add frames or widen --frames and --every".into(),
        });
    }
    check_memory(&frames, &listing)?;
    let mut parts: Vec<Parts> = frames.into_par_iter().map(assemble).collect();
    problems.extend(check_together(&mut parts, &mut notes).err());
    note_masks(&parts, &mut notes);
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
    let content = SequenceContent {
        name: name.clone(),
        frames,
        motion_deviation,
        focal_deviation,
        truth,
    };
    let mut sequence = None;
    // What could be read of a faulty input is no sequence, and would be found fault with again.
    if problems.is_empty() {
        match Sequence::checked(content, &listing) {
            Ok(checked) => sequence = Some(checked),
            Err(faults) => problems = faults,
        }
    }
    Ok(Examination {
        name,
        kind,
        frames: summaries,
        notes,
        problems,
        sequence,
    })
}

/// Fails where the frames would take more memory than the machine has, before any is read.
fn check_memory(frames: &[FrameDraft], listing: &Path) -> Result<(), SequenceError> {
    let pixels = |frame: &FrameDraft| dimensions(&frame.image).map_or(0, |(width, height)| width * height);
    let needed = frames.par_iter().map(pixels).sum::<usize>() as f64 * BYTES_PER_PIXEL;
    match memory_bytes() {
        Some(there) if needed > there => Err(SequenceError::invalid(
            listing,
            "frames",
            format!(
                "{} pictures would take about {:.1} GB of memory, this machine has {:.1}",
                frames.len(),
                needed / 1e9,
                there / 1e9
            ),
            "make the pictures smaller, or choose fewer with --frames and --every",
        )),
        _ => Ok(()),
    }
}

/// Says what all masks have in common and is unlike masks of an object, and which way pictures were taken.
fn note_masks(parts: &[Parts], notes: &mut Vec<String>) {
    let masks: Vec<&Mask> = parts.iter().filter_map(|parts| parts.mask.as_ref()).collect();
    let at_border = masks
        .iter()
        .filter(|mask| mask.border_share() > SUSPICIOUS_BORDER)
        .count();
    if 2 * at_border > masks.len() {
        let mean = |of: fn(&Mask) -> f64| {
            100.0 * masks.iter().map(|mask| of(mask)).sum::<f64>() / masks.len() as f64
        };
        notes.push(format!(
            "the masks cover {:.0} % of the pictures and {:.0} % of their borders; are they inverted? White is the object",
            mean(Mask::share),
            mean(Mask::border_share)
        ));
    }
    let unturned = parts
        .iter()
        .filter(|parts| !parts.left_unturned.is_none())
        .count();
    if unturned > 0 {
        notes.push(format!(
            "{unturned} pictures are to be turned before they are shown (EXIF); they are taken as they are stored, as the tool \
             that found the cameras does, and so must their masks be"
        ));
    }
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
