//! Draft → pixels: reads every file of a frame, checks sizes and content, undistorts, and collects all faults.

use super::Frame;
use super::depth::{DepthOrigin, clear_unusable, read_off_the_shelf_depth};
use super::distortion::Distortion;
use super::draft::FrameDraft;
use super::error::SequenceError;
use super::undistort::distorted_from_pinhole;
use crate::geometry::Pose;
use crate::image::{
    DepthMap, Grid, ImageError, Mask, PictureFile, RgbImage, Turn, mask_of_pixels, read_depth,
    read_deviation, rgb,
};
use std::path::Path;

/// What could be read of one frame; everything that could not is in `problems`.
pub(super) struct Parts {
    pub draft: FrameDraft,
    pub image: Option<RgbImage>,
    pub mask: Option<Mask>,
    pub depth: Option<DepthMap>,
    pub depth_origin: DepthOrigin,
    pub depth_deviation: Option<Grid<f32>>,
    /// What the image's file says of turning it, where it was not done: structure from motion takes pixels as they are stored.
    pub left_unturned: Turn,
    /// `camera_from_object` and z in object units.
    pub truth: Option<(Pose, DepthMap)>,
    pub notes: Vec<String>,
    pub problems: Vec<SequenceError>,
}

impl Parts {
    /// The frame and its truth; `None` unless image and mask are there.
    pub fn into_frame(self) -> Option<(Frame, Option<(Pose, DepthMap)>)> {
        let frame = Frame {
            image: self.image?.into(),
            mask: self.mask?,
            name: self.draft.name,
            camera: self.draft.camera,
            timestamp_s: self.draft.timestamp_s,
            camera_from_input: self.draft.camera_from_input,
            depth: self.depth,
            depth_deviation: self.depth_deviation,
        };
        Some((frame, self.truth))
    }

    pub fn size(&self) -> Option<(usize, usize)> {
        self.image.as_ref().map(RgbImage::size)
    }

    pub fn keep<T, E: Into<SequenceError>>(&mut self, outcome: Result<T, E>) -> Option<T> {
        outcome.map_err(|error| self.problems.push(error.into())).ok()
    }

    /// A file's content, with a missing file's message naming what it would have been.
    pub fn read<T>(&mut self, what: &str, outcome: Result<T, ImageError>) -> Option<T> {
        let outcome = outcome.map_err(|error| match error {
            ImageError::Missing(file) => SequenceError::Missing {
                file,
                what: format!("{what} of frame `{}`", self.draft.name),
                mend: "put it there or leave the frame out".into(),
            },
            other => other.into(),
        });
        self.keep(outcome)
    }

    pub fn of_image_size<T>(&mut self, grid: Grid<T>, file: &Path, what: &str) -> Option<Grid<T>> {
        match self.size() {
            Some(expected) if expected != grid.size() => {
                self.problems.push(SequenceError::Size {
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
}

pub(super) fn assemble(draft: FrameDraft) -> Parts {
    let mut parts = Parts {
        draft,
        image: None,
        mask: None,
        depth: None,
        depth_origin: DepthOrigin::None,
        depth_deviation: None,
        left_unturned: Turn::default(),
        truth: None,
        notes: Vec::new(),
        problems: Vec::new(),
    };
    parts.image = read_image(&mut parts);
    parts.mask = read_object_mask(&mut parts);
    parts.depth = read_off_the_shelf_depth(&mut parts);
    parts.depth_deviation = read_depth_deviation(&mut parts);
    parts.truth = read_truth(&mut parts);
    undistort(&mut parts);
    parts
}

fn read_image(parts: &mut Parts) -> Option<RgbImage> {
    let outcome = PictureFile::read(&parts.draft.image);
    let picture = parts.read("image", outcome)?;
    let stored = (picture.pixels.width() as usize, picture.pixels.height() as usize);
    let image = if parts.draft.calibrated_size == Some(stored) {
        parts.left_unturned = picture.turn;
        rgb(picture.pixels)
    } else {
        rgb(picture.upright())
    };
    match parts.draft.calibrated_size {
        Some(expected) if expected != image.size() => {
            parts.problems.push(SequenceError::Size {
                file: parts.draft.image.clone(),
                what: "image".into(),
                found: image.size(),
                expected,
                mend: format!(
                    "use the image that {} was made from",
                    parts.draft.declared_in.display()
                ),
            });
            None
        }
        _ => Some(image),
    }
}

fn read_object_mask(parts: &mut Parts) -> Option<Mask> {
    let file = parts.draft.mask.clone();
    let picture = parts.read("mask", PictureFile::read(&file))?;
    // A tool that copied the image's EXIF data to the mask made it as the image is stored.
    let pixels = if picture.turn == parts.left_unturned {
        picture.pixels
    } else {
        picture.upright()
    };
    let mask = parts.keep(mask_of_pixels(pixels, &file))?;
    let mask = parts.of_image_size(mask, &file, "mask")?;
    if !mask.data().contains(&true) {
        parts.problems.push(SequenceError::EmptyMask(file));
        return None;
    }
    match mask.covers_all() {
        None => Some(mask),
        Some(problem) => {
            parts.problems.push(ImageError::Mask { file, problem }.into());
            None
        }
    }
}

fn read_depth_deviation(parts: &mut Parts) -> Option<Grid<f32>> {
    let file = parts.draft.depth_deviation.clone()?;
    let deviation = parts.read("deviation of the depth", read_deviation(&file))?;
    let mut deviation = parts.of_image_size(deviation, &file, "deviation of the depth")?;
    clear_unusable(&mut deviation);
    Some(deviation)
}

fn read_truth(parts: &mut Parts) -> Option<(Pose, DepthMap)> {
    let truth = parts.draft.truth.as_ref()?;
    let (pose, file) = (truth.camera_from_object, truth.depth.clone());
    let depth = parts.read("true depth", read_depth(&file))?;
    let mut depth = parts.of_image_size(depth, &file, "true depth")?;
    clear_unusable(&mut depth);
    Some((pose, depth))
}

fn undistort(parts: &mut Parts) {
    let Some(size) = parts.size() else { return };
    if parts.draft.distortion == Distortion::None {
        return;
    }
    let map = distorted_from_pinhole(&parts.draft.camera, &parts.draft.distortion, size);
    let refused = |reason| SequenceError::Undistort {
        file: parts.draft.declared_in.clone(),
        reason,
    };
    let image = parts
        .image
        .as_ref()
        .map(|image| map.rgb(image))
        .transpose()
        .map_err(refused);
    let mask = parts
        .mask
        .as_ref()
        .map(|mask| map.mask(mask))
        .transpose()
        .map_err(refused);
    let depth = match &parts.depth {
        // Points were projected through the pinhole already.
        Some(depth) if parts.depth_origin == DepthOrigin::Dense => {
            map.depth(depth).map(Some).map_err(refused)
        }
        _ => Ok(parts.depth.take()),
    };
    let object = |mask: &Mask| mask.data().iter().filter(|&&inside| inside).count();
    let object_before = parts.mask.as_ref().map_or(0, object);
    let cut_before = parts.mask.as_ref().is_some_and(|mask| mask.border_count() > 0);
    parts.image = parts.keep(image).flatten();
    parts.mask = parts.keep(mask).flatten();
    parts.depth = parts.keep(depth).flatten();
    // Without OpenCV all three fail for one reason.
    parts.problems.dedup_by_key(|problem| problem.to_string());
    let Some(mask) = &parts.mask else { return };
    if object(mask) == 0 {
        let file = parts.draft.declared_in.clone();
        parts.problems.push(SequenceError::Undistort {
            file,
            reason: format!(
                "its lens coefficients put none of the {object_before} pixels of the object of frame `{}` into the \
                 undistorted image; calibrate again",
                parts.draft.name
            ),
        });
        parts.mask = None;
    } else if !cut_before && mask.border_count() > 0 {
        let name = &parts.draft.name;
        parts.notes.push(format!(
            "frame {name}: undistortion moves part of the object out of the image"
        ));
    }
}
