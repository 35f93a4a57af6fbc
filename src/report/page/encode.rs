//! Pictures and arrays of numbers as text inside the page.

use crate::image::{DepthMap, Mask, RgbImage};
use crate::report::{colormap, overlay};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::ImageEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::imageops;

/// No picture of the page has more pixels on its longer side.
const LONGEST_SIDE: f64 = 720.0;
/// Nor do all pictures together have more pixels, so that a page of many frames stays below about 8 MB.
const ALL_PIXELS: f64 = 8e6;
const JPEG_QUALITY: u8 = 84;
/// Steps of the colour scale that the page interpolates between.
const COLOURS: usize = 64;

/// The factor by which the pictures of a page with `frame_count` of them are made smaller, at most 1.
pub(super) fn scale((width, height): (usize, usize), frame_count: usize) -> f64 {
    let (width, height) = (width as f64, height as f64);
    let by_side = LONGEST_SIDE / width.max(height);
    let by_area = (ALL_PIXELS / (width * height * frame_count as f64)).sqrt();
    by_side.min(by_area).min(1.0)
}

/// A picture as the page shows it, with what is known of its pixels.
pub(super) struct Layers<'a> {
    pub image: &'a RgbImage,
    pub mask: &'a Mask,
    /// z of the shape that was found, 0 = none.
    pub depth: &'a DepthMap,
    /// z of the input in the same units, inside the mask, 0 = none.
    pub input_depth: Option<&'a DepthMap>,
    /// The inverse depths at the ends of the colour scale: far and near.
    pub range: (f32, f32),
}

impl Layers<'_> {
    /// The picture as a JPEG, and as a PNG of the same size what lies over it: red and green are the inverse depths found and given, from
    /// 1 = far to 255 = near, 0 = none; blue is 255 inside the mask. Both are `data:` addresses.
    pub fn encode(&self, scale: f64) -> Result<[String; 2], image::ImageError> {
        let (width, height) = self.image.size();
        let shrunk = |side: usize| ((side as f64 * scale).round() as u32).max(1);
        let (columns, rows) = (shrunk(width), shrunk(height));
        let mut picture = overlay::picture(self.image);
        if (columns, rows) != picture.dimensions() {
            picture = imageops::resize(&picture, columns, rows, imageops::FilterType::Triangle);
        }
        let layers = image::RgbImage::from_fn(columns, rows, |column, row| {
            let nearest = |at: u32, of: u32, side: usize| {
                (((f64::from(at) + 0.5) * side as f64 / f64::from(of)) as usize).min(side - 1)
            };
            let at = (nearest(column, columns, width), nearest(row, rows, height));
            let given = self.input_depth.map_or(0.0, |depth| depth[at]);
            image::Rgb([
                self.level(self.depth[at]),
                self.level(given),
                if self.mask[at] { 255 } else { 0 },
            ])
        });
        let (mut jpeg, mut png) = (Vec::new(), Vec::new());
        JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY).encode_image(&picture)?;
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive).write_image(
            &layers,
            columns,
            rows,
            image::ExtendedColorType::Rgb8,
        )?;
        Ok([data_url("image/jpeg", &jpeg), data_url("image/png", &png)])
    }

    fn level(&self, z: f32) -> u8 {
        let (far, near) = self.range;
        if z > 0.0 {
            let share = (1.0 / z - far) / (near - far).max(1e-6);
            1 + (254.0 * share.clamp(0.0, 1.0)).round() as u8
        } else {
            0
        }
    }
}

pub(super) fn data_url(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", base64(bytes))
}

pub(super) fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// Numbers of four bytes each, little-endian.
pub(super) fn base64_floats<const N: usize>(rows: &[[f32; N]]) -> String {
    let bytes: Vec<u8> = rows
        .iter()
        .flatten()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    base64(&bytes)
}

/// The colours of inverse depth at even steps.
pub(super) fn colour_scale() -> Vec<[u8; 3]> {
    (0..COLOURS)
        .map(|step| colormap::colour(step as f32 / (COLOURS - 1) as f32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    fn decoded(address: &str, kind: &str) -> image::RgbImage {
        let bytes = STANDARD.decode(address.strip_prefix(kind).unwrap()).unwrap();
        image::load_from_memory(&bytes).unwrap().into_rgb8()
    }

    #[test]
    fn layers_hold_both_depths_and_the_mask() {
        let image: RgbImage = Grid::filled(8, 4, [200.0, 100.0, 50.0]);
        let mask = Grid::from_fn(8, 4, |column, _| column < 4);
        let depth = Grid::from_fn(8, 4, |column, _| if column < 2 { 1.0 } else { 0.0 });
        let given = Grid::from_fn(8, 4, |column, _| if column < 4 { 2.0 } else { 0.0 });
        let layers = Layers {
            image: &image,
            mask: &mask,
            depth: &depth,
            input_depth: Some(&given),
            range: (0.5, 1.0),
        };
        let [jpeg, png] = layers.encode(0.5).unwrap();
        let (picture, pixels) = (
            decoded(&jpeg, "data:image/jpeg;base64,"),
            decoded(&png, "data:image/png;base64,"),
        );
        assert_eq!((picture.dimensions(), pixels.dimensions()), ((4, 2), (4, 2)));
        let colour = picture.get_pixel(1, 1).0;
        for (part, expected) in colour.into_iter().zip([200u8, 100, 50]) {
            assert!(part.abs_diff(expected) <= 3, "{colour:?}");
        }
        assert_eq!(pixels.get_pixel(0, 1).0, [255, 1, 255]);
        assert_eq!(pixels.get_pixel(1, 0).0, [0, 1, 255]);
        assert_eq!(pixels.get_pixel(3, 1).0, [0, 0, 0]);
    }

    #[test]
    fn few_small_pictures_keep_their_size_and_many_large_ones_do_not() {
        assert_eq!(scale((320, 240), 10), 1.0);
        assert_eq!(scale((1440, 960), 2), 0.5);
        let many = scale((960, 640), 90);
        assert!((many * many * 960.0 * 640.0 * 90.0 - ALL_PIXELS).abs() < 1.0);
    }
}
