//! Masks from files, brought to the frames that were made of their pictures.

use crate::image::{Grid, ImageError, Mask, PictureFile, mask_of, mask_of_pixels};
use crate::prepare::photos::Origin;
use crate::prepare::{Photo, PrepareError};
use crate::sequence::SequenceError;
use image::DynamicImage;
use std::path::{Path, PathBuf};

/// From this share of a picture's border in more than half of the masks on, they are doubted.
const SUSPICIOUS_BORDER: f64 = 0.5;

/// A picture's mask as its file has it.
struct Read {
    file: PathBuf,
    pixels: DynamicImage,
    /// Whether it has to be turned as its photo was.
    lies: bool,
}

/// One mask a photo, and how they came about, in words.
///
/// # Errors
/// A mask that is missing, is none, or is not of its photo's shape.
pub fn given(folder: &Path, photos: &[Photo]) -> Result<(Vec<Mask>, String), PrepareError> {
    let read = photos
        .iter()
        .map(|photo| read(folder, photo))
        .collect::<Result<Vec<_>, _>>()?;
    // A tool that makes one mask as the photo is stored makes all so.
    let all_lie = read.iter().any(|read| read.lies);
    let mut words = "from files".to_owned();
    let turned = |photo: &&Photo| matches!(photo.origin, Origin::File(turn) if !turn.is_none());
    let count = photos.iter().filter(turned).count();
    if all_lie {
        words += &format!(", {count} turned as their photos' EXIF data say");
    } else if photos.iter().any(|photo| turned(&photo) && !tells_turning(photo)) {
        words += &format!(", taken to be upright, unlike {count} of the photos as they are stored (EXIF)");
    }
    let masks = read
        .into_iter()
        .zip(photos)
        .map(|(read, photo)| mask(read, photo, all_lie))
        .collect::<Result<Vec<_>, _>>()?;
    let at_border = masks
        .iter()
        .filter(|mask| mask.border_share() > SUSPICIOUS_BORDER)
        .count();
    if 2 * at_border > masks.len() {
        words +=
            ", IN DOUBT: most cover more than half of the border; are they inverted? White is the object";
    }
    Ok((masks, words))
}

/// Whether a mask's width and height tell if it was turned.
fn tells_turning(photo: &Photo) -> bool {
    let (width, height) = photo.image.size();
    matches!(photo.origin, Origin::File(turn) if turn.swaps_sides()) && width != height
}

fn read(folder: &Path, photo: &Photo) -> Result<Read, PrepareError> {
    let file = mask_of(folder, &photo.name);
    let picture = PictureFile::read(&file)?;
    // One with EXIF data of its own says itself how it is shown.
    let is_turned = !picture.turn.is_none();
    let pixels = picture.upright();
    let (width, height) = (pixels.width() as usize, pixels.height() as usize);
    let lies = !is_turned
        && !has_shape(photo, width, height)
        && tells_turning(photo)
        && has_shape(photo, height, width);
    if !lies && !has_shape(photo, width, height) {
        let (shown_width, shown_height) = photo.image.size();
        let original = |side: usize| (side as f64 / photo.scale).round() as usize;
        return Err(SequenceError::Size {
            file,
            what: "mask".into(),
            found: (width, height),
            expected: (original(shown_width), original(shown_height)),
            mend: "give it the photo's shape, turned as the photo is shown".into(),
        }
        .into());
    }
    Ok(Read { file, pixels, lies })
}

/// Whether a mask of that size, made larger or smaller alike along both sides, covers the photo, up to a pixel's rounding.
fn has_shape(photo: &Photo, width: usize, height: usize) -> bool {
    let (photo_width, photo_height) = photo.image.size();
    let scaled = height as f64 * photo_width as f64 / width as f64;
    (scaled - photo_height as f64).abs() <= 1.0
}

fn mask(read: Read, photo: &Photo, all_lie: bool) -> Result<Mask, ImageError> {
    let pixels = match photo.origin {
        Origin::File(turn) if read.lies || all_lie && !tells_turning(photo) => turn.apply(read.pixels),
        _ => read.pixels,
    };
    let mask = mask_of_pixels(pixels, &read.file)?;
    if let Some(problem) = mask.covers_all() {
        return Err(ImageError::Mask {
            file: read.file,
            problem,
        });
    }
    let (width, height) = photo.image.size();
    // Pictures may have been made smaller than their masks.
    let at = |x: usize, to: usize, from: usize| (x * from + from / 2) / to;
    Ok(Grid::from_fn(width, height, |column, row| {
        mask[(at(column, width, mask.width()), at(row, height, mask.height()))]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Turn, exif_jpeg, write_mask};

    /// A photo of 30 × 40 pixels that was stored so.
    fn photo(turn: Turn) -> Photo {
        Photo {
            name: "a".into(),
            image: Grid::filled(30, 40, [0.0; 3]),
            seconds: None,
            focal_px: None,
            scale: 0.5,
            origin: Origin::File(turn),
        }
    }

    fn turn(orientation: u16) -> Turn {
        let bytes = exif_jpeg(
            (8, 8),
            &[(exif::Tag::Orientation, exif::Value::Short(vec![orientation]))],
        );
        PictureFile::decode(&bytes).unwrap().turn
    }

    /// The mask of a photo from a file of that size whose upper left quarter is the object.
    fn of(size: (usize, usize), photos: &[Photo]) -> Result<(Vec<Mask>, String), PrepareError> {
        let folder = tempfile::tempdir().unwrap();
        let (width, height) = size;
        let mask = Grid::from_fn(width, height, |x, y| 2 * x < width && 2 * y < height);
        write_mask(&mask, &folder.path().join("a.png")).unwrap();
        given(folder.path(), photos)
    }

    #[test]
    fn masks_are_made_smaller_and_never_squeezed() {
        for size in [(30, 40), (60, 80), (61, 80), (15, 20)] {
            let (masks, words) = of(size, &[photo(Turn::default())]).unwrap();
            assert_eq!(
                (masks[0].size(), words.as_str()),
                ((30, 40), "from files"),
                "{size:?}"
            );
            assert!(masks[0][(13, 18)] && !masks[0][(17, 18)] && !masks[0][(13, 22)]);
        }
        for size in [(80, 60), (60, 60), (64, 80)] {
            let message = of(size, &[photo(Turn::default())]).unwrap_err().to_string();
            assert!(message.contains("but the frame is 60 × 80"), "{message}");
        }
    }

    #[test]
    fn masks_that_lie_as_the_sensor_does_are_turned_along() {
        // By a quarter to the right: what lay left and up comes to lie right and up.
        let (masks, words) = of((80, 60), &[photo(turn(6))]).unwrap();
        assert!(masks[0][(17, 18)] && !masks[0][(13, 18)] && !masks[0][(17, 22)]);
        assert!(words.contains("1 turned"), "{words}");
        let (masks, words) = of((60, 80), &[photo(turn(6))]).unwrap();
        assert!(masks[0][(13, 18)] && words == "from files", "{words}");
    }

    #[test]
    fn half_turns_do_not_show_in_a_mask_s_size() {
        let (masks, words) = of((60, 80), &[photo(turn(3))]).unwrap();
        assert!(
            masks[0][(13, 18)] && words.contains("taken to be upright"),
            "{words}"
        );
    }
}
