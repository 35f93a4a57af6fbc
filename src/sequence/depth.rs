//! Off-the-shelf depth of one frame, from whichever source its reader found, on the image's pixels.

use super::assemble::Parts;
use super::draft::DenseDepth;
use super::{SequenceError, colmap, openmvs};
use crate::geometry::{Pinhole, Vector3};
use crate::image::{DepthMap, Grid, Mask, read_depth};
use std::path::Path;

/// A depth so many times larger or smaller than the object's own is none: some tools write 10¹⁰ where they see nothing.
const OUT_OF_PROPORTION: f32 = 1e3;
/// Dense depth is of another model than sparse points whose depth it differs from by more than this factor.
const ANOTHER_MODEL: f64 = 2.0;
/// Pixels with both that tell.
const TELLING: usize = 30;

/// What a frame's depth was made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DepthOrigin {
    None,
    Dense,
    Points,
    /// Points, since the dense depth holds nothing on the object.
    PointsForEmpty,
    /// Nothing, since the dense depth holds nothing on the object, and there are no points.
    Empty,
}

pub(super) fn read_off_the_shelf_depth(parts: &mut Parts) -> Option<DepthMap> {
    let sparse = match (parts.draft.points.is_empty(), parts.size()) {
        (false, Some(size)) => Some(splat(&parts.draft.points, &parts.draft.camera, size)),
        _ => None,
    };
    let (depth, origin) = if parts.draft.depth.is_none() {
        let origin = match parts.draft.points.is_empty() {
            true => DepthOrigin::None,
            false => DepthOrigin::Points,
        };
        (sparse, origin)
    } else {
        let mut dense = read_dense(parts)?;
        let unusable = clear_unusable(&mut dense);
        // Other tools mark invalid pixels in ways of their own, so there is nothing to note.
        if unusable > 0 && matches!(parts.draft.depth, Some(DenseDepth::Exr(_))) {
            let name = &parts.draft.name;
            parts.notes.push(format!(
                "frame {name}: {unusable} depth values are negative or not finite; taken as unknown"
            ));
        }
        let is_empty = parts
            .mask
            .as_ref()
            .is_some_and(|mask| on_object(&dense, mask).next().is_none());
        match (is_empty, sparse) {
            (false, _) => (Some(dense), DepthOrigin::Dense),
            (true, Some(sparse)) => (Some(sparse), DepthOrigin::PointsForEmpty),
            (true, None) => (None, DepthOrigin::Empty),
        }
    };
    parts.depth_origin = origin;
    depth
}

fn read_dense(parts: &mut Parts) -> Option<DepthMap> {
    match parts.draft.depth.as_ref()? {
        DenseDepth::Exr(file) => {
            let file = file.clone();
            let depth = parts.read("depth map", read_depth(&file))?;
            parts.of_image_size(depth, &file, "depth map")
        }
        DenseDepth::ColmapMap(file) => {
            let file = file.clone();
            let depth = parts.keep(colmap::depth_map::read(&file))?;
            to_image_size(parts, depth, &file)
        }
        DenseDepth::OpenMvsMap(file) => {
            let file = file.clone();
            let depth = parts.keep(openmvs::depth_map::read(&file))?.depth;
            to_image_size(parts, depth, &file)
        }
    }
}

/// The known depths on the object.
fn on_object<'a>(depth: &'a DepthMap, mask: &'a Mask) -> impl Iterator<Item = f32> + 'a {
    let pixels = depth.data().iter().zip(mask.data());
    pixels.filter(|&(&z, &inside)| inside && z > 0.0).map(|(&z, _)| z)
}

/// What the depths of all frames say together: leaves out what is out of proportion, and holds dense depth against sparse points.
pub(super) fn check_together(frames: &mut [Parts], notes: &mut Vec<String>) -> Result<(), SequenceError> {
    note_origins(frames, notes);
    let mut known: Vec<f32> = frames
        .iter()
        .filter_map(|parts| Some((parts.depth.as_ref()?, parts.mask.as_ref()?)))
        .flat_map(|(depth, mask)| on_object(depth, mask))
        .collect();
    let Some(usual) = median(&mut known) else {
        return Ok(());
    };
    let mut left_out = 0;
    for depth in frames.iter_mut().filter_map(|parts| parts.depth.as_mut()) {
        for z in depth.data_mut() {
            if *z > 0.0 && !(usual / OUT_OF_PROPORTION..=usual * OUT_OF_PROPORTION).contains(z) {
                *z = 0.0;
                left_out += 1;
            }
        }
    }
    if left_out > 0 {
        notes.push(format!(
            "{left_out} depth values are more than {OUT_OF_PROPORTION} times larger or smaller than the object's ({usual:.3}); \
             taken as unknown"
        ));
    }
    hold_against_points(frames)
}

/// Says where frames have their depth from, unless it is as planned.
fn note_origins(frames: &[Parts], notes: &mut Vec<String>) {
    let count = |origin| frames.iter().filter(|parts| parts.depth_origin == origin).count();
    for (origin, what) in [
        (
            DepthOrigin::Points,
            "have no dense depth; the sparse points that each observes serve as semi-dense depth",
        ),
        (
            DepthOrigin::PointsForEmpty,
            "have dense depth that is empty on the object; the sparse points that each observes serve as semi-dense depth",
        ),
        (
            DepthOrigin::Empty,
            "have dense depth that is empty on the object, and no points: no depth at all",
        ),
    ] {
        if count(origin) > 0 {
            notes.push(format!("{} frames {what}", count(origin)));
        }
    }
}

/// Fails where dense depth and sparse points differ in scale: they are of different models.
fn hold_against_points(frames: &[Parts]) -> Result<(), SequenceError> {
    let mut ratios = Vec::new();
    let mut file = None;
    for parts in frames
        .iter()
        .filter(|parts| parts.depth_origin == DepthOrigin::Dense)
    {
        let (Some(dense), Some(mask)) = (&parts.depth, &parts.mask) else {
            continue;
        };
        let sparse = splat(&parts.draft.points, &parts.draft.camera, dense.size());
        let both = dense.data().iter().zip(sparse.data()).zip(mask.data());
        ratios.extend(
            both.filter(|((dense, sparse), inside)| **inside && **dense > 0.0 && **sparse > 0.0)
                .map(|((dense, sparse), _)| dense / sparse),
        );
        file = file.or(parts.draft.depth.as_ref());
    }
    let (Some(DenseDepth::Exr(file) | DenseDepth::ColmapMap(file) | DenseDepth::OpenMvsMap(file)), true) =
        (file, ratios.len() >= TELLING)
    else {
        return Ok(());
    };
    match median(&mut ratios).map(f64::from) {
        Some(ratio) if !(1.0 / ANOTHER_MODEL..=ANOTHER_MODEL).contains(&ratio) => {
            Err(SequenceError::invalid(
                file,
                "depth",
                format!(
                    "it is {ratio:.3} times the depth of the sparse points, the median over all frames: of another model"
                ),
                "compute dense depth from the model in sparse/ again, or take it away",
            ))
        }
        _ => Ok(()),
    }
}

fn median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
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
pub(super) fn clear_unusable(depth: &mut DepthMap) -> usize {
    let mut count = 0;
    for z in depth.data_mut() {
        if !(z.is_finite() && *z >= 0.0) {
            *z = 0.0;
            count += 1;
        }
    }
    count
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
