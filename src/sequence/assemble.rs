//! Draft → pixels: reads every file of a frame, checks sizes and content, undistorts, and collects all faults.

use super::Frame;
use super::colmap;
use super::distortion::Distortion;
use super::draft::{DepthSource, FrameDraft};
use super::error::SequenceError;
use super::openmvs;
use super::undistort::distorted_from_pinhole;
use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::{DepthMap, Grid, ImageError, Mask, RgbImage, read_depth, read_mask, read_rgb};
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

    fn size(&self) -> Option<(usize, usize)> {
        self.image.as_ref().map(RgbImage::size)
    }

    fn keep<T, E: Into<SequenceError>>(&mut self, outcome: Result<T, E>) -> Option<T> {
        outcome.map_err(|error| self.problems.push(error.into())).ok()
    }

    /// A file's content, with a missing file's message naming what it would have been.
    fn read<T>(&mut self, what: &str, outcome: Result<T, ImageError>) -> Option<T> {
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

    fn of_image_size<T>(&mut self, grid: Grid<T>, file: &Path, what: &str) -> Option<Grid<T>> {
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
        truth: None,
        notes: Vec::new(),
        problems: Vec::new(),
    };
    parts.image = read_image(&mut parts);
    parts.mask = read_object_mask(&mut parts);
    parts.depth = read_off_the_shelf_depth(&mut parts);
    parts.truth = read_truth(&mut parts);
    undistort(&mut parts);
    parts
}

fn read_image(parts: &mut Parts) -> Option<RgbImage> {
    let outcome = read_rgb(&parts.draft.image);
    let image = parts.read("image", outcome)?;
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
    let mask = parts.read("mask", read_mask(&file))?;
    let mask = parts.of_image_size(mask, &file, "mask")?;
    if mask.data().contains(&true) {
        Some(mask)
    } else {
        parts.problems.push(SequenceError::EmptyMask(file));
        None
    }
}

fn read_off_the_shelf_depth(parts: &mut Parts) -> Option<DepthMap> {
    let mut depth = match &parts.draft.depth {
        DepthSource::None => return None,
        DepthSource::Exr(file) => {
            let file = file.clone();
            let depth = parts.read("depth map", read_depth(&file))?;
            let mut depth = parts.of_image_size(depth, &file, "depth map")?;
            let unusable = clear_unusable(&mut depth);
            if unusable > 0 {
                let name = &parts.draft.name;
                parts.notes.push(format!(
                    "frame {name}: {unusable} depth values are negative or not finite; taken as unknown"
                ));
            }
            depth
        }
        // Tools mark invalid pixels in ways of their own, so there is nothing to note.
        DepthSource::ColmapMap(file) => {
            let file = file.clone();
            let depth = parts.keep(colmap::depth_map::read(&file))?;
            to_image_size(parts, depth, &file)?
        }
        DepthSource::OpenMvsMap(file) => {
            let file = file.clone();
            let depth = parts.keep(openmvs::depth_map::read(&file))?.depth;
            to_image_size(parts, depth, &file)?
        }
        DepthSource::Points(points) => return Some(splat(points, &parts.draft.camera, parts.size()?)),
    };
    clear_unusable(&mut depth);
    Some(depth)
}

fn read_truth(parts: &mut Parts) -> Option<(Pose, DepthMap)> {
    let truth = parts.draft.truth.as_ref()?;
    let (pose, file) = (truth.camera_from_object, truth.depth.clone());
    let depth = parts.read("true depth", read_depth(&file))?;
    let depth = parts.of_image_size(depth, &file, "true depth")?;
    Some((pose, depth))
}

/// Tools may compute depth on a reduced image: such a map is enlarged, each pixel taking the nearest value.
fn to_image_size(parts: &mut Parts, depth: DepthMap, file: &Path) -> Option<DepthMap> {
    let Some((width, height)) = parts.size() else {
        return Some(depth);
    };
    let (from_width, from_height) = depth.size();
    // Equal up to the rounding of the reduced size to whole pixels.
    let same_shape = (from_width * height).abs_diff(from_height * width) <= width.max(height);
    if !same_shape || from_width > width || from_height > height {
        return parts.of_image_size(depth, file, "depth map");
    }
    Some(Grid::from_fn(width, height, |column, row| {
        let nearest = |i: usize, from: usize, to: usize| ((2 * i + 1) * from / (2 * to)).min(from - 1);
        depth[(
            nearest(column, from_width, width),
            nearest(row, from_height, height),
        )]
    }))
}

/// z of the nearest point in every pixel that a point (camera frame) projects to.
fn splat(points: &[Vector3<f64>], camera: &Pinhole, (width, height): (usize, usize)) -> DepthMap {
    let mut depth = Grid::filled(width, height, 0.0f32);
    for point in points {
        let pixel = camera.project(point).and_then(|at| depth.pixel_at(at.x, at.y));
        if let Some(pixel) = pixel {
            let (known, z) = (depth[pixel], point.z as f32);
            depth[pixel] = if known > 0.0 { known.min(z) } else { z };
        }
    }
    depth
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
    let depth = match (&parts.depth, &parts.draft.depth) {
        // Points were projected through the pinhole already.
        (Some(depth), source) if !matches!(source, DepthSource::Points(_)) => {
            map.depth(depth).map(Some).map_err(refused)
        }
        _ => Ok(parts.depth.take()),
    };
    let cut_before = parts.mask.as_ref().is_some_and(|mask| mask.border_count() > 0);
    parts.image = parts.keep(image).flatten();
    parts.mask = parts.keep(mask).flatten();
    parts.depth = parts.keep(depth).flatten();
    // Without OpenCV all three fail for one reason.
    parts.problems.dedup_by_key(|problem| problem.to_string());
    if !cut_before && parts.mask.as_ref().is_some_and(|mask| mask.border_count() > 0) {
        let name = &parts.draft.name;
        parts.notes.push(format!(
            "frame {name}: undistortion moves part of the object out of the image"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_land_in_their_pixel_and_the_nearest_wins() {
        let camera = Pinhole {
            fx: 10.0,
            fy: 10.0,
            cx: 4.0,
            cy: 3.0,
        };
        let at = |u: f64, v: f64, z: f64| camera.unproject(&nalgebra::Vector2::new(u, v), z);
        let points = [
            at(2.9, 1.1, 5.0),
            at(2.1, 1.9, 3.0),
            at(2.5, 1.5, 4.0),
            at(-0.1, 1.0, 1.0),
            at(1.0, 1.0, -2.0),
        ];
        let depth = splat(&points, &camera, (8, 6));
        assert_eq!(depth[(2, 1)], 3.0);
        assert_eq!(depth.data().iter().filter(|&&z| z > 0.0).count(), 1);
    }

    #[test]
    fn what_is_no_depth_becomes_unknown() {
        let mut depth = Grid::from_vec(5, 1, vec![1.0, -1.0, f32::NAN, f32::INFINITY, 0.0]).unwrap();
        assert_eq!(clear_unusable(&mut depth), 3);
        assert_eq!(depth.data(), [1.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
