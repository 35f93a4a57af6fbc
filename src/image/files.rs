//! Colour images and masks as PNG or JPEG files.

use super::{Grid, ImageError, Mask, RgbImage};
use std::path::{Path, PathBuf};

/// Reads a PNG or JPEG (told by content, not by name) as RGB in \[0, 255\].
pub fn read_rgb(file: &Path) -> Result<RgbImage, ImageError> {
    Ok(rgb(decode(file)?))
}

/// Likewise, scaled to cover `width` × `height` (both positive) and cropped about its middle to that size.
pub fn read_rgb_covering(file: &Path, width: usize, height: usize) -> Result<RgbImage, ImageError> {
    // Triangle: a mean over what a pixel covers, without the overshoot of the sharper filters.
    let filter = image::imageops::FilterType::Triangle;
    Ok(rgb(decode(file)?.resize_to_fill(
        width as u32,
        height as u32,
        filter,
    )))
}

/// Where a picture's mask is: named like the picture, with or without the picture's own ending (`a.png` or `a.jpg.png` for `a.jpg`).
/// `name` is the picture's, without its ending. A file that does not exist where there is no mask.
pub fn mask_of(folder: &Path, name: &str) -> Result<PathBuf, ImageError> {
    let belongs = |file: &PathBuf| {
        let stem = file.file_stem().map(Path::new);
        let name = Some(std::ffi::OsStr::new(name));
        stem.map(Path::as_os_str) == name || stem.and_then(Path::file_stem) == name
    };
    let entries = std::fs::read_dir(folder).map_err(|source| ImageError::read(folder, source))?;
    let files = entries.flatten().map(|entry| entry.path());
    Ok(files
        .filter(belongs)
        .min()
        .unwrap_or_else(|| folder.join(format!("{name}.png"))))
}

/// Reads a mask: true where the image's brightness exceeds 127.
pub fn read_mask(file: &Path) -> Result<Mask, ImageError> {
    let pixels = decode(file)?.into_luma8();
    Ok(Grid::from_fn(
        pixels.width() as usize,
        pixels.height() as usize,
        |column, row| pixels.get_pixel(column as u32, row as u32).0[0] > 127,
    ))
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

fn rgb(decoded: image::DynamicImage) -> RgbImage {
    let pixels = decoded.into_rgb8();
    Grid::from_fn(
        pixels.width() as usize,
        pixels.height() as usize,
        |column, row| pixels.get_pixel(column as u32, row as u32).0.map(f32::from),
    )
}

fn decode(file: &Path) -> Result<image::DynamicImage, ImageError> {
    let bytes = std::fs::read(file).map_err(|source| ImageError::read(file, source))?;
    let reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|source| ImageError::read(file, source))?;
    reader.decode().map_err(|error| ImageError::Decode {
        file: file.to_owned(),
        reason: one_line(&error.to_string()),
    })
}

fn write_png(
    file: &Path,
    (width, height): (usize, usize),
    bytes: Vec<u8>,
    colour: image::ExtendedColorType,
) -> Result<(), ImageError> {
    image::save_buffer_with_format(
        file,
        &bytes,
        width as u32,
        height as u32,
        colour,
        image::ImageFormat::Png,
    )
    .map_err(|error| ImageError::Write {
        file: file.to_owned(),
        reason: one_line(&error.to_string()),
    })
}

/// Messages of other libraries may span lines; ours never do.
pub(crate) fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_mask_is_true_above_127() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mask.png");
        write_png(
            &file,
            (4, 1),
            vec![0, 127, 128, 255],
            image::ExtendedColorType::L8,
        )
        .unwrap();
        assert_eq!(read_mask(&file).unwrap().data(), [false, false, true, true]);
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
