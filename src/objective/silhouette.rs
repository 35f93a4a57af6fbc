//! What a frame's mask gives to Eq. 5.

use super::ObjectiveOptions;
use super::options::limit;
use crate::bridge::ceres::ffi;
use crate::image::Mask;
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

/// What a frame's mask gives to the term.
pub(super) fn share(frame: &Frame, options: &ObjectiveOptions) -> ffi::SilhouetteShare {
    let pixels: Vec<u32> = (0u32..)
        .zip(frame.mask.data())
        .filter(|(_, inside)| **inside)
        .map(|(i, _)| i)
        .collect();
    let used = thinned(&pixels, limit(options.silhouette_pixels, pixels.len()));
    let points = limit(options.silhouette_points, options.points);
    ffi::SilhouetteShare {
        pixel_weight: pixels.len() as f64 / used.len() as f64,
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
    fn thinning_keeps_all_or_spreads() {
        let all: Vec<u32> = (0..10).collect();
        assert_eq!(thinned(&all, 10), all);
        assert_eq!(thinned(&all, 2), [2, 7]);
    }
}
