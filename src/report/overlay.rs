//! Overlays: the image, the visible shape coloured by inverse depth over it, the given mask's outline on top.

use super::colormap;
use crate::image::{DepthMap, Mask, RgbImage};
use image::{Rgb, RgbImage as Picture};

/// How much of the image the shape hides.
const OPACITY: f32 = 0.62;
const OUTLINE: [u8; 3] = [64, 255, 220];
/// Darkens what touches the outline from outside, so that it stands out on bright ground too.
const HALO: f32 = 0.45;

/// The frame as an 8-bit picture.
pub(super) fn picture(image: &RgbImage) -> Picture {
    Picture::from_fn(image.width() as u32, image.height() as u32, |column, row| {
        let colour = image[(column as usize, row as usize)];
        Rgb(colour.map(|part| part.round().clamp(0.0, 255.0) as u8))
    })
}

/// Brighter = closer; the scale spans the 1st to the 99th percentile of this frame's inverse depths.
pub(super) fn overlay(image: &RgbImage, depth: &DepthMap, mask: &Mask) -> Picture {
    let mut picture = picture(image);
    let (far, near) = inverse_depth_range(depth);
    for (column, row, pixel) in picture.enumerate_pixels_mut() {
        let at = (column as usize, row as usize);
        let z = depth[at];
        if z > 0.0 {
            let colour = colormap::colour((1.0 / z - far) / (near - far).max(1e-6));
            *pixel = blend(*pixel, colour, OPACITY);
        }
        if mask[at] {
            if touches(mask, at, false) {
                *pixel = Rgb(OUTLINE);
            }
        } else if touches(mask, at, true) {
            *pixel = blend(*pixel, [0; 3], HALO);
        }
    }
    picture
}

fn blend(under: Rgb<u8>, over: [u8; 3], opacity: f32) -> Rgb<u8> {
    let mix = |a: u8, b: u8| (f32::from(a) + opacity * (f32::from(b) - f32::from(a))).round() as u8;
    Rgb(std::array::from_fn(|c| mix(under.0[c], over[c])))
}

/// One of the four neighbours inside the image is `value`.
fn touches(mask: &Mask, (column, row): (usize, usize), value: bool) -> bool {
    [
        (column.wrapping_sub(1), row),
        (column + 1, row),
        (column, row.wrapping_sub(1)),
        (column, row + 1),
    ]
    .into_iter()
    .any(|(column, row)| mask.get(column, row) == Some(&value))
}

/// The inverse depths at the far and the near end of the colour scale.
pub(super) fn inverse_depth_range(depth: &DepthMap) -> (f32, f32) {
    let mut inverse: Vec<f32> = depth
        .data()
        .iter()
        .filter(|&&z| z > 0.0)
        .map(|z| 1.0 / z)
        .collect();
    inverse.sort_by(f32::total_cmp);
    let last = inverse.len().saturating_sub(1);
    let at = |share: f64| {
        inverse
            .get((share * last as f64).round() as usize)
            .copied()
            .unwrap_or(0.0)
    };
    (at(0.01), at(0.99))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn the_shape_shows_within_and_the_outline_on_the_mask() {
        let image: RgbImage = Grid::filled(12, 10, [100.0; 3]);
        let mask = Grid::from_fn(12, 10, |column, row| {
            (3..9).contains(&column) && (2..8).contains(&row)
        });
        let depth = Grid::from_fn(12, 10, |column, row| match (column, row) {
            (4..6, 3..7) => 1.0,
            (6..8, 3..7) => 4.0,
            _ => 0.0,
        });
        let picture = overlay(&image, &depth, &mask);
        assert_eq!(picture.get_pixel(3, 4).0, OUTLINE);
        assert_eq!(picture.get_pixel(0, 0).0, [100; 3]);
        assert_eq!(picture.get_pixel(2, 4).0, [55; 3]);
        let near = picture.get_pixel(4, 4).0[1];
        let far = picture.get_pixel(7, 4).0[1];
        assert!(near > far, "closer must be brighter: {near} against {far}");
    }
}
