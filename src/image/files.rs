//! Colour images and masks as PNG or JPEG files.

use super::picture::{PictureFile, colours};
use super::{Grid, ImageError, Mask, RgbImage};
use image::ImageEncoder;
use std::path::Path;

/// Reads a PNG or JPEG (told by content, not by name) as RGB in \[0, 255\], turned as a viewer shows it.
pub fn read_rgb(file: &Path) -> Result<RgbImage, ImageError> {
    Ok(rgb(PictureFile::read(file)?.upright()))
}

/// Likewise, scaled to cover `width` × `height` (both positive) and cropped about its middle to that size.
pub fn read_rgb_covering(file: &Path, width: usize, height: usize) -> Result<RgbImage, ImageError> {
    // Triangle: a mean over what a pixel covers, without the overshoot of the sharper filters.
    let filter = image::imageops::FilterType::Triangle;
    Ok(rgb(PictureFile::read(file)?.upright().resize_to_fill(
        width as u32,
        height as u32,
        filter,
    )))
}

/// Writes a colour image as 8-bit PNG, values rounded and clamped to \[0, 255\].
pub fn write_rgb(image: &RgbImage, file: &Path) -> Result<(), ImageError> {
    let bytes = image
        .data()
        .iter()
        .flatten()
        .map(|value| value.round().clamp(0.0, 255.0) as u8)
        .collect();
    write_png(file, image.size(), bytes, image::ExtendedColorType::Rgb8)
}

/// Writes a mask as 8-bit grey PNG: 255 on the object, 0 elsewhere.
pub fn write_mask(mask: &Mask, file: &Path) -> Result<(), ImageError> {
    let bytes = mask
        .data()
        .iter()
        .map(|&inside| if inside { 255 } else { 0 })
        .collect();
    write_png(file, mask.size(), bytes, image::ExtendedColorType::L8)
}

/// A decoded picture's colours; what is transparent is white.
pub(crate) fn rgb(decoded: image::DynamicImage) -> RgbImage {
    let pixels = colours(decoded);
    Grid::from_fn(
        pixels.width() as usize,
        pixels.height() as usize,
        |column, row| pixels.get_pixel(column as u32, row as u32).0.map(f32::from),
    )
}

fn write_png(
    file: &Path,
    (width, height): (usize, usize),
    bytes: Vec<u8>,
    colour: image::ExtendedColorType,
) -> Result<(), ImageError> {
    let mut png = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    encoder
        .write_image(&bytes, width as u32, height as u32, colour)
        .map_err(std::io::Error::other)
        .and_then(|()| std::fs::write(file, png))
        .map_err(|problem| ImageError::Write {
            file: file.to_owned(),
            problem,
        })
}

/// Messages of other libraries may span lines; ours never do.
pub(crate) fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::read_mask;

    #[test]
    fn colour_and_masks_survive_the_disk() {
        let folder = tempfile::tempdir().unwrap();
        let image = Grid::from_fn(5, 3, |c, r| [c as f32 * 50.0, r as f32 * 100.0, 255.0]);
        let mask = Grid::from_fn(5, 3, |c, r| (c + r) % 2 == 0);
        write_rgb(&image, &folder.path().join("image.png")).unwrap();
        write_mask(&mask, &folder.path().join("mask.png")).unwrap();
        assert_eq!(read_rgb(&folder.path().join("image.png")).unwrap(), image);
        assert_eq!(read_mask(&folder.path().join("mask.png")).unwrap(), mask);
    }

    #[test]
    fn a_covering_image_keeps_its_shape_and_middle() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("wide.png");
        // Four times as wide as high: covering a square of half its height crops 3/8 of it on either side.
        let ramp = Grid::from_fn(160, 40, |c, r| [c as f32, 4.0 * r as f32, 7.0]);
        write_rgb(&ramp, &file).unwrap();
        let covering = read_rgb_covering(&file, 20, 20).unwrap();
        assert_eq!(covering.size(), (20, 20));
        let [left, top, _] = covering[(2, 2)];
        assert!(
            (left - 64.5).abs() < 1.0 && (top - 18.0).abs() < 2.0,
            "{left} {top}"
        );
        let [right, bottom, blue] = covering[(17, 17)];
        assert!(
            (right - 94.5).abs() < 1.0 && (bottom - 138.0).abs() < 2.0,
            "{right} {bottom}"
        );
        assert_eq!(blue, 7.0);
    }

    #[test]
    fn a_text_file_does_not_decode() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("image.png");
        std::fs::write(&file, "not an image").unwrap();
        let message = read_rgb(&file).unwrap_err().to_string();
        assert!(message.contains("image.png: image does not decode"), "{message}");
        assert!(matches!(
            read_rgb(&folder.path().join("none.png")),
            Err(ImageError::Missing(_))
        ));
    }
}
