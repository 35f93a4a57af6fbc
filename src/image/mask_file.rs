//! Mask files: what of their pixels is the object.
//!
//! The object is what is white, or the brighter of two values whatever they are, or what is opaque. Files that hold something else,
//! as a label map, or a picture with the object painted over, are refused.

use super::picture::PictureFile;
use super::{Grid, ImageError, Mask};
use image::{DynamicImage, RgbaImage};
use std::path::Path;

/// Above this, what has more than two values is white.
const WHITE: u8 = 127;
/// JPEG moves black and white by no more than this.
const NOISE: u8 = 24;
/// The channels of a grey pixel differ by no more than this once JPEG is through with them.
const GREY: u8 = 40;
/// From this share of coloured pixels on, a file is no mask: JPEG colours edges alone.
const COLOURED: f64 = 0.01;
/// One value between black and white with this share is a label; what blurs an edge has many.
const LABEL: f64 = 0.02;
/// From this share of pixels between black and white on, a file is a picture.
const IN_BETWEEN: f64 = 0.25;
/// A mask with this share of its picture, or of its picture's border, outlines nothing.
const ALL: f64 = 0.9;

/// Reads a mask, turned as a viewer shows it.
///
/// # Errors
/// A file that is missing, does not decode, or is no mask.
pub fn read_mask(file: &Path) -> Result<Mask, ImageError> {
    mask_of_pixels(PictureFile::read(file)?.upright(), file)
}

/// What of the pixels of `file` is the object.
pub(crate) fn mask_of_pixels(pixels: DynamicImage, file: &Path) -> Result<Mask, ImageError> {
    object(pixels).map_err(|problem| ImageError::Mask {
        file: file.to_owned(),
        problem,
    })
}

impl Mask {
    /// What is wrong with a mask that leaves (nearly) nothing out, in words.
    pub fn covers_all(&self) -> Option<String> {
        let (share, border) = (self.share(), self.border_share());
        (share >= ALL || border >= ALL).then(|| {
            format!(
                "it covers {:.0} % of the picture and {:.0} % of its border (is it inverted?)",
                100.0 * share,
                100.0 * border
            )
        })
    }
}

/// The object, or why it cannot be told.
fn object(pixels: DynamicImage) -> Result<Mask, String> {
    let (width, height) = (pixels.width() as usize, pixels.height() as usize);
    let values = match pixels {
        // Labels of 16 bits, which are all black in 8.
        DynamicImage::ImageLuma16(grey) if grey.iter().all(|&value| value < 256) => {
            grey.iter().map(|&value| value as u8).collect()
        }
        pixels => brightness(&pixels.into_rgba8())?,
    };
    let above = threshold(&values)?;
    let inside = values.into_iter().map(|value| value > above).collect();
    Grid::from_vec(width, height, inside).ok_or_else(|| "it has no pixels".into())
}

/// How white each pixel is, as far as it is opaque.
fn brightness(pixels: &RgbaImage) -> Result<Vec<u8>, String> {
    let luma = |[r, g, b, _]: [u8; 4]| {
        // Rec. 709, as the library's own conversion has it.
        ((2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b)) / 10_000) as u8
    };
    let all = || pixels.pixels().map(|pixel| pixel.0);
    let (clear, opaque): (Vec<[u8; 4]>, Vec<[u8; 4]>) = all().partition(|pixel| pixel[3] <= WHITE);
    let cut_out = !clear.is_empty() && !opaque.is_empty();
    if cut_out && !is_black_and_white(&opaque) {
        // The colours are the object's own, or none.
        return Ok(all().map(|pixel| pixel[3]).collect());
    }
    let shown = |pixel: [u8; 4]| {
        if cut_out && pixel[3] <= WHITE {
            [0; 4]
        } else {
            pixel
        }
    };
    if let Some(brighter) = brighter_of_two(all().map(shown), luma) {
        return Ok(all()
            .map(|pixel| if shown(pixel)[..3] == brighter { u8::MAX } else { 0 })
            .collect());
    }
    let coloured = |[r, g, b, _]: [u8; 4]| r.max(g).max(b) - r.min(g).min(b) > GREY;
    let share = all().filter(|&pixel| coloured(pixel)).count() as f64 / all().count().max(1) as f64;
    if share >= COLOURED {
        return Err(format!(
            "{:.0} % of it is coloured, in more than two colours: a label map, or a picture with the object painted over",
            100.0 * share
        ));
    }
    Ok(all().map(|pixel| luma(shown(pixel))).collect())
}

/// Whether there are black pixels and white ones, and no others.
fn is_black_and_white(pixels: &[[u8; 4]]) -> bool {
    let all = |value: u8| move |pixel: &&[u8; 4]| pixel[..3] == [value; 3];
    let (black, white) = (
        pixels.iter().filter(all(0)).count(),
        pixels.iter().filter(all(u8::MAX)).count(),
    );
    black > 0 && white > 0 && black + white == pixels.len()
}

/// The brighter of the colours, if there are exactly two.
fn brighter_of_two(pixels: impl Iterator<Item = [u8; 4]>, luma: impl Fn([u8; 4]) -> u8) -> Option<[u8; 3]> {
    let mut found: Vec<[u8; 4]> = Vec::new();
    for pixel in pixels {
        if !found.iter().any(|known| known[..3] == pixel[..3]) {
            found.push(pixel);
        }
        if found.len() > 2 {
            return None;
        }
    }
    found.sort_by_key(|&pixel| luma(pixel));
    match found[..] {
        [darker, brighter] if are_meant(luma(darker), luma(brighter)) => {
            Some([brighter[0], brighter[1], brighter[2]])
        }
        _ => None,
    }
}

/// Whether two values are a mask's: two whites are what JPEG makes of one.
fn are_meant(darker: u8, brighter: u8) -> bool {
    darker <= WHITE || brighter - darker > NOISE
}

/// The value above which pixels are the object.
fn threshold(values: &[u8]) -> Result<u8, String> {
    let mut counts = [0usize; 256];
    for &value in values {
        counts[usize::from(value)] += 1;
    }
    let share = |count: usize| count as f64 / values.len().max(1) as f64;
    let known: Vec<u8> = (0..=u8::MAX)
        .filter(|&value| counts[usize::from(value)] > 0)
        .collect();
    if let [darker, brighter] = known[..]
        && are_meant(darker, brighter)
    {
        return Ok(darker);
    }
    let labels = known.len() > 2 && known.last().is_some_and(|&most| most <= NOISE);
    let between = |value: &u8| *value > NOISE && *value < u8::MAX - NOISE;
    let flat = known
        .iter()
        .filter(|&value| between(value) && share(counts[usize::from(*value)]) >= LABEL);
    let flat: Vec<String> = if labels { known.iter() } else { [].iter() }
        .chain(flat)
        .map(u8::to_string)
        .collect();
    if known.len() > 2 && !flat.is_empty() {
        return Err(format!(
            "it has more than two values ({}): a label map",
            flat.join(", ")
        ));
    }
    let grey: usize = (64..192).map(|value| counts[value]).sum();
    if known.len() > 2 && share(grey) >= IN_BETWEEN {
        return Err(format!(
            "{:.0} % of it is neither black nor white",
            100.0 * share(grey)
        ));
    }
    Ok(WHITE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma, Rgb, RgbImage, Rgba};

    /// 40 × 30 pixels with the object, a box of 16 × 10 pixels, in the middle.
    fn inside(x: u32, y: u32) -> bool {
        (12..28).contains(&x) && (10..20).contains(&y)
    }

    fn expected() -> Mask {
        Grid::from_fn(40, 30, |x, y| inside(x as u32, y as u32))
    }

    fn grey(value: impl Fn(u32, u32) -> u8) -> DynamicImage {
        GrayImage::from_fn(40, 30, |x, y| Luma([value(x, y)])).into()
    }

    fn rgb(object: [u8; 3], else_: [u8; 3]) -> DynamicImage {
        RgbImage::from_fn(40, 30, |x, y| Rgb(if inside(x, y) { object } else { else_ })).into()
    }

    #[test]
    fn two_values_are_meant_as_they_are_whatever_they_are() {
        for (object, else_) in [(255, 0), (1, 0), (38, 0), (255, 200), (200, 100)] {
            let found = super::object(grey(|x, y| if inside(x, y) { object } else { else_ }));
            assert_eq!(found, Ok(expected()), "{object} {else_}");
        }
        for (object_colour, else_) in [
            ([128, 0, 0], [0; 3]),
            ([255, 0, 0], [0; 3]),
            ([255, 255, 0], [68, 1, 84]),
        ] {
            assert_eq!(
                object(rgb(object_colour, else_)),
                Ok(expected()),
                "{object_colour:?}"
            );
        }
        let deep = image::ImageBuffer::from_fn(40, 30, |x, y| Luma([u16::from(inside(x, y))]));
        assert_eq!(object(DynamicImage::ImageLuma16(deep)), Ok(expected()));
    }

    #[test]
    fn a_cut_out_s_alpha_is_its_mask() {
        let with = |pixel: &dyn Fn(u32, u32) -> [u8; 4]| {
            object(image::RgbaImage::from_fn(40, 30, |x, y| Rgba(pixel(x, y))).into())
        };
        let alpha = |x, y| if inside(x, y) { 255 } else { 0 };
        let photo = |x: u32, y: u32| [5 * x as u8, 7 * y as u8, 90];
        // The object's colours; black alone; white alone; white where it is opaque and where it is not.
        for colour in [&photo as &dyn Fn(u32, u32) -> [u8; 3], &|_, _| [0; 3], &|_, _| {
            [255; 3]
        }] {
            let found = with(&|x, y| {
                let [r, g, b] = colour(x, y);
                [r, g, b, alpha(x, y)]
            });
            assert_eq!(found, Ok(expected()));
        }
        // A mask in black and white whose outermost columns are clear, or that is clear or opaque throughout.
        for opaque in [&(|x: u32| x > 0) as &dyn Fn(u32) -> bool, &|_| true, &|_| false] {
            let found = with(&|x, y| {
                let value = if inside(x, y) { 255 } else { 0 };
                [value, value, value, if opaque(x) { 255 } else { 0 }]
            });
            assert_eq!(found, Ok(expected()));
        }
    }

    #[test]
    fn blurred_edges_and_jpegs_noise_are_split_in_the_middle() {
        let soft = grey(|x, y| match (inside(x, y), inside(x + 1, y)) {
            (true, _) => 255 - (x % 3) as u8,
            (false, true) => 120 + y as u8 % 8,
            (false, false) => (y % 4) as u8,
        });
        assert_eq!(object(soft), Ok(expected()));
        let mut bytes = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 75)
            .encode_image(&rgb([255; 3], [0; 3]))
            .unwrap();
        assert_eq!(object(image::load_from_memory(&bytes).unwrap()), Ok(expected()));
    }

    #[test]
    fn what_is_no_mask_is_refused() {
        let refused = |pixels, words: &str| {
            let problem = object(pixels).unwrap_err();
            assert!(problem.contains(words), "{problem}");
        };
        let three = |a: u8, b: u8| {
            grey(move |x, y| match (inside(x, y), x < 12) {
                (true, _) => a,
                (false, true) => b,
                _ => 0,
            })
        };
        refused(three(255, 128), "more than two values (128)");
        refused(three(2, 1), "more than two values (0, 1, 2)");
        refused(grey(|x, y| (5 * x + y) as u8), "neither black nor white");
        let labels = RgbImage::from_fn(40, 30, |x, y| match (inside(x, y), x < 12) {
            (true, _) => Rgb([128, 0, 0]),
            (false, true) => Rgb([0, 128, 0]),
            _ => Rgb([0; 3]),
        });
        refused(labels.into(), "coloured");
        let overlay = RgbImage::from_fn(40, 30, |x, y| match inside(x, y) {
            true => Rgb([250, 3 * x as u8, 3 * y as u8]),
            false => Rgb([(5 * x + y) as u8; 3]),
        });
        refused(overlay.into(), "coloured");
    }

    #[test]
    fn a_single_value_is_all_or_nothing() {
        for (value, all) in [(0, false), (127, false), (128, true), (255, true)] {
            assert_eq!(
                object(grey(|_, _| value)),
                Ok(Grid::filled(40, 30, all)),
                "{value}"
            );
        }
        assert_eq!(
            object(grey(|x, _| 254 + (x % 2) as u8)),
            Ok(Grid::filled(40, 30, true))
        );
    }

    #[test]
    fn masks_that_leave_nothing_out_are_told() {
        assert_eq!(expected().covers_all(), None);
        let inverted = Grid::from_fn(40, 30, |x, y| !inside(x as u32, y as u32));
        assert!(inverted.covers_all().unwrap().contains("100 % of its border"));
        // Black at the border alone.
        let within = Grid::from_fn(400, 300, |x, y| x > 0 && y > 0 && x < 399 && y < 299);
        assert!(within.covers_all().unwrap().contains("0 % of its border"));
        // A close-up that leaves three sides.
        let near = Grid::from_fn(40, 30, |x, y| x > 5 && y > 3);
        assert_eq!(near.covers_all(), None);
    }
}
