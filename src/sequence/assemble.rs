//! Draft → pixels: reads every file of a frame, checks sizes and content, undistorts, and collects all faults.

use super::Frame;
use super::draft::{DepthSource, FrameDraft};
use super::error::SequenceError;
use crate::geometry::Pose;
use crate::image::{DepthMap, ImageError, Mask, RgbImage, read_depth, read_mask, read_rgb};
use std::path::Path;

/// What could be read of one frame; everything that could not is in `problems`.
pub(super) struct Parts {
    pub draft: FrameDraft,
    pub image: Option<RgbImage>,
    pub mask: Option<Mask>,
    pub depth: Option<DepthMap>,
    /// `camera_from_object` and z in object units.
    pub truth: Option<(Pose, DepthMap)>,
    pub notes: Vec<String>,
    pub problems: Vec<SequenceError>,
}

impl Parts {
    /// The frame and its truth; `None` unless image and mask are there.
    pub fn into_frame(self) -> Option<(Frame, Option<(Pose, DepthMap)>)> {
        let frame = Frame {
            image: self.image?,
            mask: self.mask?,
            name: self.draft.name,
            camera: self.draft.camera,
            timestamp_s: self.draft.timestamp_s,
            camera_from_input: self.draft.camera_from_input,
            depth: self.depth,
        };
        Some((frame, self.truth))
    }
}

pub(super) fn assemble(draft: FrameDraft) -> Parts {
    let mut problems = Vec::new();
    let mut notes = Vec::new();
    let image = keep(read_rgb(&draft.image), &mut problems).filter(|image| {
        let fits = draft.calibrated_size.is_none_or(|size| size == image.size());
        if let (false, Some(expected)) = (fits, draft.calibrated_size) {
            problems.push(SequenceError::Size {
                file: draft.image.clone(),
                what: "image".into(),
                found: image.size(),
                expected,
                mend: format!(
                    "the camera in {} belongs to another size",
                    draft.declared_in.display()
                ),
            });
        }
        fits
    });
    let size = image.as_ref().map(RgbImage::size);
    let mask = keep(read_mask(&draft.mask), &mut problems)
        .and_then(|mask| same_size(mask, size, &draft.mask, "mask", &mut problems))
        .filter(|mask| {
            let object = mask.data().contains(&true);
            if !object {
                problems.push(SequenceError::EmptyMask(draft.mask.clone()));
            }
            object
        });
    let depth = read_off_the_shelf(&draft, size, &mut notes, &mut problems);
    let truth = draft.truth.as_ref().and_then(|truth| {
        let depth = keep(read_depth(&truth.depth), &mut problems)?;
        let depth = same_size(depth, size, &truth.depth, "true depth", &mut problems)?;
        Some((truth.camera_from_object, depth))
    });
    Parts {
        draft,
        image,
        mask,
        depth,
        truth,
        notes,
        problems,
    }
}

fn read_off_the_shelf(
    draft: &FrameDraft,
    size: Option<(usize, usize)>,
    notes: &mut Vec<String>,
    problems: &mut Vec<SequenceError>,
) -> Option<DepthMap> {
    let mut depth = match &draft.depth {
        DepthSource::None => return None,
        DepthSource::Exr(file) => {
            let depth = keep(read_depth(file), problems)?;
            same_size(depth, size, file, "depth map", problems)?
        }
    };
    let unusable = clear_unusable(&mut depth);
    if unusable > 0 {
        notes.push(format!(
            "frame {}: {unusable} depth values are negative or not finite; taken as unknown",
            draft.name
        ));
    }
    Some(depth)
}

/// Sets what is no depth to 0 (unknown); returns how many there were.
fn clear_unusable(depth: &mut DepthMap) -> usize {
    let mut count = 0;
    for z in depth.data_mut() {
        if !(z.is_finite() && *z >= 0.0) {
            *z = 0.0;
            count += 1;
        }
    }
    count
}

fn same_size<T>(
    grid: crate::image::Grid<T>,
    expected: Option<(usize, usize)>,
    file: &Path,
    what: &str,
    problems: &mut Vec<SequenceError>,
) -> Option<crate::image::Grid<T>> {
    match expected {
        Some(expected) if expected != grid.size() => {
            problems.push(SequenceError::Size {
                file: file.to_owned(),
                what: what.into(),
                found: grid.size(),
                expected,
                mend: "make it the image's size".into(),
            });
            None
        }
        _ => Some(grid),
    }
}

fn keep<T>(outcome: Result<T, ImageError>, problems: &mut Vec<SequenceError>) -> Option<T> {
    outcome.map_err(|error| problems.push(error.into())).ok()
}
