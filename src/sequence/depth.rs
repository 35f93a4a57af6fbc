//! Off-the-shelf depth of one frame, from whichever source its reader found, on the image's pixels.

use super::assemble::Parts;
use super::draft::DepthSource;
use super::{colmap, openmvs};
use crate::geometry::{Pinhole, Vector3};
use crate::image::{DepthMap, Grid, read_depth};
use std::path::Path;

pub(super) fn read_off_the_shelf_depth(parts: &mut Parts) -> Option<DepthMap> {
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
