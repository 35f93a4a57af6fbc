//! What a frame's mask gives to Eq. 5.

use super::ObjectiveOptions;
use super::options::limit;
use crate::bridge::ceres::ffi;
use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::{Grid, Mask};
use crate::sequence::Frame;

/// How many pixels are one of the images that [`ObjectiveOptions::silhouette_size`] speaks of.
pub(super) fn unit_px(frames: &[Frame], silhouette_size: f64) -> f64 {
    let inside = |frame: &Frame| frame.mask.data().iter().filter(|&&inside| inside).count();
    let area = frames.iter().map(inside).sum::<usize>() as f64 / frames.len().max(1) as f64;
    if silhouette_size > 0.0 && area > 0.0 {
        area.sqrt() / silhouette_size
    } else {
        1.0
    }
}

/// What a frame's mask gives to the term, where so many pixels are one of [`ObjectiveOptions::silhouette_size`]'s images.
pub(super) fn share(frame: &Frame, options: &ObjectiveOptions, unit_px: f64) -> ffi::SilhouetteShare {
    let pixels: Vec<u32> = (0u32..)
        .zip(frame.mask.data())
        .filter(|(_, inside)| **inside)
        .map(|(i, _)| i)
        .collect();
    let used = thinned(&pixels, limit(options.silhouette_pixels, pixels.len()));
    let points = limit(options.silhouette_points, options.points);
    ffi::SilhouetteShare {
        // A sum over the pixels of those images, as that over points does not grow with the resolution either.
        pixel_weight: pixels.len() as f64 / (unit_px * unit_px * used.len() as f64),
        pixels: used,
        points: points as u32,
        point_weight: options.point_weight * options.points as f64 / points as f64,
    }
}

/// `count` of `all`, evenly spread over the list.
fn thinned(all: &[u32], count: usize) -> Vec<u32> {
    (0..count)
        .map(|i| all[(2 * i + 1) * all.len() / (2 * count)])
        .collect()
}

/// Pixels of [`ObjectiveOptions::silhouette_size`]'s images by which a point must miss a mask to be outside it.
const CLEARLY_OUTSIDE: f64 = 3.0;
/// The share of frames that say so up to which they are the ones that err, and from which they are not.
const AGREED: [f64; 2] = [0.25, 0.75];

/// Whether each of `points` (object frame) is clearly outside a frame's mask, of which `outside_px` has the distances; `None` where the image
/// does not show it.
pub(super) fn outside(
    outside_px: &Grid<u8>,
    camera: &Pinhole,
    camera_from_object: &Pose,
    points: &[Vector3<f64>],
    unit_px: f64,
) -> Vec<Option<bool>> {
    let far = CLEARLY_OUTSIDE * unit_px;
    let of = |point: &Vector3<f64>| {
        let at = camera.project(&camera_from_object.transform(point))?;
        if at.x < 0.0 || at.y < 0.0 {
            return None;
        }
        let distance = outside_px.get(at.x as usize, at.y as usize)?;
        Some(f64::from(*distance) > far)
    };
    points.iter().map(of).collect()
}

/// From 0, no more frames say that a point is outside than may err, to 1.
pub(super) fn agreement(outside: impl Iterator<Item = bool>) -> f64 {
    let (mut agree, mut all) = (0u32, 0u32);
    for is_outside in outside {
        all += 1;
        agree += u32::from(is_outside);
    }
    let share = f64::from(agree) / f64::from(all.max(1));
    ((share - AGREED[0]) / (AGREED[1] - AGREED[0])).clamp(0.0, 1.0)
}

/// Row-major indices of the mask's pixels that touch a pixel outside it or the image's border.
pub(super) fn boundary(mask: &Mask) -> Vec<u32> {
    let inside = |column: usize, row: usize| mask.get(column, row).is_some_and(|&inside| inside);
    let mut indices = Vec::new();
    for row in 0..mask.height() {
        for column in 0..mask.width() {
            let surrounded = inside(column.wrapping_sub(1), row)
                && inside(column + 1, row)
                && inside(column, row.wrapping_sub(1))
                && inside(column, row + 1);
            if mask[(column, row)] && !surrounded {
                indices.push((row * mask.width() + column) as u32);
            }
        }
    }
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_boundary_of_a_block() {
        let mask = Mask::from_fn(6, 5, |column, row| {
            (1..5).contains(&column) && (1..4).contains(&row)
        });
        let inner = [(2, 2), (3, 2)];
        let expected: Vec<u32> = (0..30u32)
            .filter(|i| {
                let pixel = ((i % 6) as usize, (i / 6) as usize);
                mask[pixel] && !inner.contains(&pixel)
            })
            .collect();
        assert_eq!(boundary(&mask), expected);
    }

    #[test]
    fn points_clearly_beside_the_mask_are_outside() {
        let mask = Mask::from_fn(40, 10, |column, _| column < 20);
        let distances = crate::image::NearestPixel::new(&mask).unwrap().distances();
        let camera = Pinhole {
            fx: 10.0,
            fy: 10.0,
            cx: 0.0,
            cy: 0.0,
        };
        let at = |column: f64, z: f64| Vector3::new(column / 10.0 * z, 0.5 * z, z);
        // The last pixel inside is 19: 3 and 4 pixels beyond it, beside the image, behind the camera.
        let points = [
            at(5.5, 2.0),
            at(22.5, 2.0),
            at(23.5, 2.0),
            at(41.0, 2.0),
            at(5.5, -2.0),
        ];
        let found = outside(&distances, &camera, &Pose::identity(), &points, 1.0);
        assert_eq!(found, [Some(false), Some(false), Some(true), None, None]);
        let finer = outside(&distances, &camera, &Pose::identity(), &points, 2.0);
        assert_eq!(finer[2], Some(false));
    }

    #[test]
    fn few_frames_err_and_many_do_not() {
        let of = |outside: usize| agreement((0..8).map(|l| l < outside));
        assert_eq!([of(0), of(2), of(4), of(6), of(8)], [0.0, 0.0, 0.5, 1.0, 1.0]);
        assert_eq!(agreement(std::iter::empty()), 0.0);
    }

    #[test]
    fn thinning_keeps_all_or_spreads() {
        let all: Vec<u32> = (0..10).collect();
        assert_eq!(thinned(&all, 10), all);
        assert_eq!(thinned(&all, 2), [2, 7]);
    }
}
