//! Frames out of a video or a folder of photos: upright, in order, of one size, and no more than are needed.

use super::PrepareError;
use crate::bridge::vision::ffi::{self, Picture};
use crate::image::{Grid, ImageError, RgbImage, one_line};
use exif::{In, Tag};
use image::{DynamicImage, ImageDecoder};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// What can be chosen.
#[derive(Clone, Debug)]
pub struct PhotoOptions {
    /// At most so many frames: of each of as many groups, the sharpest.
    pub most: usize,
    /// The longer side of what comes out, in pixels; smaller pictures stay as they are.
    pub longest_px: usize,
}

impl Default for PhotoOptions {
    fn default() -> Self {
        Self {
            most: 40,
            longest_px: 960,
        }
    }
}

/// Where frames come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    Video(PathBuf),
    /// Pictures, by name.
    Photos(Vec<PathBuf>),
}

/// A frame.
#[derive(Clone, Debug)]
pub struct Photo {
    /// A photo's name without its ending, or a frame's number in its video.
    pub name: String,
    pub image: RgbImage,
    /// Since the video's first frame or the first photo, where known.
    pub seconds: Option<f64>,
    /// The focal length in pixels of `image` that a photo's EXIF data give.
    pub focal_px: Option<f64>,
    /// The image's size over that of the original.
    pub scale: f64,
}

impl Input {
    /// What is at a path.
    ///
    /// # Errors
    /// Nothing there, or a folder without two pictures.
    pub fn find(path: &Path) -> Result<Self, PrepareError> {
        if !path.exists() {
            return Err(PrepareError::Missing(path.to_owned()));
        }
        if path.is_file() {
            return Ok(Self::Video(path.to_owned()));
        }
        let read = |source| PrepareError::Read {
            file: path.to_owned(),
            source,
        };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(path).map_err(read)? {
            let file = entry.map_err(read)?.path();
            let known = file
                .extension()
                .and_then(|ending| ending.to_str())
                .is_some_and(|ending| ["jpg", "jpeg", "png"].contains(&ending.to_lowercase().as_str()));
            if known && file.is_file() {
                files.push(file);
            }
        }
        if files.len() < 2 {
            return Err(PrepareError::TooFew {
                input: path.to_owned(),
                found: files.len(),
                mend: "give a folder of PNG or JPEG pictures of one object, or a video",
            });
        }
        files.sort_by_key(|file| natural_key(&file.file_name().unwrap_or_default().to_string_lossy()));
        Ok(Self::Photos(files))
    }

    /// All files it is made of.
    pub fn files(&self) -> Vec<PathBuf> {
        match self {
            Self::Video(file) => vec![file.clone()],
            Self::Photos(files) => files.clone(),
        }
    }

    /// The chosen frames.
    ///
    /// # Errors
    /// Pictures that cannot be read, of different sizes, or too few frames.
    pub fn read(&self, options: &PhotoOptions) -> Result<Vec<Photo>, PrepareError> {
        match self {
            Self::Video(file) => video(file, options),
            Self::Photos(files) => photos(files, options),
        }
    }
}

/// Numbers in names by their value: frame2 before frame10.
fn natural_key(name: &str) -> Vec<(u64, String)> {
    let mut key = vec![(0u64, String::new())];
    let mut digits = false;
    for letter in name.chars() {
        if letter.is_ascii_digit() != digits {
            digits = letter.is_ascii_digit();
            if digits {
                key.push((0, String::new()));
            }
        }
        let last = key.len() - 1;
        match letter.to_digit(10) {
            Some(digit) => key[last].0 = key[last].0.saturating_mul(10).saturating_add(u64::from(digit)),
            None => key[last].1.push(letter),
        }
    }
    key
}

fn video(file: &Path, options: &PhotoOptions) -> Result<Vec<Photo>, PrepareError> {
    let path = file.to_string_lossy();
    let open = || {
        let video = ffi::open_video(&path)?;
        if video.is_null() {
            return Err(PrepareError::NoVideo(file.to_owned()));
        }
        Ok(video)
    };
    let mut sharpness = Vec::new();
    let mut decoder = open()?;
    let mut picture = Picture::default();
    while decoder.pin_mut().next(&mut picture)? {
        sharpness.push(ffi::sharpness(&small(&picture, 320)?)?);
    }
    // Headers alone open, too.
    if sharpness.is_empty() {
        return Err(PrepareError::NoVideo(file.to_owned()));
    }
    let chosen = sharpest(&sharpness, options.most);
    if chosen.len() < 2 {
        return Err(PrepareError::TooFew {
            input: file.to_owned(),
            found: chosen.len(),
            mend: "give a longer video",
        });
    }
    let mut photos = Vec::with_capacity(chosen.len());
    let mut decoder = open()?;
    let mut number = 0;
    while decoder.pin_mut().next(&mut picture)? {
        if chosen.binary_search(&number).is_ok() {
            let kept = small(&picture, options.longest_px)?;
            photos.push(Photo {
                name: format!("{number:06}"),
                image: rgb(&kept),
                seconds: Some(kept.seconds),
                focal_px: None,
                scale: kept.width as f64 / picture.width as f64,
            });
        }
        number += 1;
    }
    Ok(photos)
}

/// The sharpest of each of `most` groups of frames in a row, in order.
fn sharpest(sharpness: &[f64], most: usize) -> Vec<usize> {
    let groups = sharpness.len().min(most);
    (0..groups)
        .filter_map(|group| {
            let range = group * sharpness.len() / groups..(group + 1) * sharpness.len() / groups;
            range.max_by(|&a, &b| sharpness[a].total_cmp(&sharpness[b]))
        })
        .collect()
}

struct Decoded {
    picture: Picture,
    focal_px: Option<f64>,
    scale: f64,
    /// Whole seconds of a calendar.
    seconds: Option<u64>,
    sharpness: f64,
}

fn photos(files: &[PathBuf], options: &PhotoOptions) -> Result<Vec<Photo>, PrepareError> {
    let mut decoded: Vec<(&PathBuf, Decoded)> = files
        .par_iter()
        .map(|file| Ok((file, decode(file, options.longest_px)?)))
        .collect::<Result<_, PrepareError>>()?;
    // Cameras start their numbers anew; within a second, names decide.
    if decoded.iter().all(|(_, d)| d.seconds.is_some()) {
        decoded.sort_by_key(|(_, d)| d.seconds);
    }
    let sizes: Vec<(usize, usize)> = decoded
        .iter()
        .map(|(_, d)| (d.picture.width, d.picture.height))
        .collect();
    let count = |size: &(usize, usize)| sizes.iter().filter(|other| *other == size).count();
    if let Some(&expected) = sizes.iter().max_by_key(|size| count(size))
        && let Some(odd) = sizes.iter().position(|size| *size != expected)
    {
        return Err(PrepareError::MixedSizes {
            file: decoded[odd].0.clone(),
            found: sizes[odd],
            expected,
        });
    }
    let sharpness: Vec<f64> = decoded.iter().map(|(_, d)| d.sharpness).collect();
    let first = decoded.iter().find_map(|(_, d)| d.seconds);
    Ok(sharpest(&sharpness, options.most)
        .into_iter()
        .map(|index| {
            let (file, decoded) = &decoded[index];
            let name = file.file_stem().unwrap_or_default();
            Photo {
                name: name.to_string_lossy().into_owned(),
                image: rgb(&decoded.picture),
                seconds: decoded
                    .seconds
                    .zip(first)
                    .map(|(seconds, first)| seconds.abs_diff(first) as f64),
                focal_px: decoded.focal_px,
                scale: decoded.scale,
            }
        })
        .collect())
}

fn decode(file: &Path, longest_px: usize) -> Result<Decoded, PrepareError> {
    let bytes = std::fs::read(file).map_err(|source| ImageError::read(file, source))?;
    let refused = |error: image::ImageError| ImageError::Decode {
        file: file.to_owned(),
        reason: one_line(&error.to_string()),
    };
    let mut decoder = image::ImageReader::new(std::io::Cursor::new(&bytes))
        .with_guessed_format()
        .map_err(|source| ImageError::read(file, source))?
        .into_decoder()
        .map_err(refused)?;
    let orientation = decoder.orientation().map_err(refused)?;
    let mut upright = DynamicImage::from_decoder(decoder).map_err(refused)?;
    upright.apply_orientation(orientation);
    let pixels = upright.into_rgb8();
    let whole = Picture {
        width: pixels.width() as usize,
        height: pixels.height() as usize,
        rgb: pixels.into_raw(),
        seconds: 0.0,
    };
    let exif = exif::Reader::new()
        .read_from_container(&mut std::io::Cursor::new(&bytes))
        .ok();
    let picture = small(&whole, longest_px)?;
    let sharpness = ffi::sharpness(&small(&picture, 320)?)?;
    Ok(Decoded {
        focal_px: exif
            .as_ref()
            .and_then(|exif| focal_px(exif, picture.width, picture.height)),
        seconds: exif.as_ref().and_then(seconds),
        scale: picture.width as f64 / whole.width as f64,
        sharpness,
        picture,
    })
}

/// Diagonal of 35 mm film, in millimetres.
pub(super) const FILM_DIAGONAL_MM: f64 = 43.266_615_305_567_87;
/// Sensor widths in millimetres; a model's name as EXIF data have it.
const SENSOR_WIDTHS: [(&str, f64); 6] = [
    ("NIKON D70", 23.7),
    ("NIKON D80", 23.6),
    ("NIKON D90", 23.6),
    ("Canon EOS 300D", 22.7),
    ("Canon EOS 400D", 22.2),
    ("Canon EOS 5D", 35.8),
];

/// The focal length in pixels of a picture of this size.
fn focal_px(exif: &exif::Exif, width: usize, height: usize) -> Option<f64> {
    let number = |tag| match &exif.get_field(tag, In::PRIMARY)?.value {
        exif::Value::Rational(values) => values.first().map(exif::Rational::to_f64),
        value => value.get_uint(0).map(f64::from),
    };
    let positive = |value: &f64| value.is_finite() && *value > 0.0;
    // The 35 mm equivalent is rounded to millimetres; a known sensor is better.
    let sensor_mm = exif.get_field(Tag::Model, In::PRIMARY).and_then(|model| {
        let model = model.display_value().to_string();
        SENSOR_WIDTHS
            .iter()
            .find(|(known, _)| model.contains(known))
            .map(|(_, mm)| mm)
    });
    if let Some((focal_mm, sensor_mm)) = number(Tag::FocalLength).filter(positive).zip(sensor_mm) {
        return Some(focal_mm / sensor_mm * width.max(height) as f64);
    }
    let equivalent = number(Tag::FocalLengthIn35mmFilm).filter(positive)?;
    Some(equivalent / FILM_DIAGONAL_MM * (width as f64).hypot(height as f64))
}

/// When a photo was taken; of use only as a difference.
fn seconds(exif: &exif::Exif) -> Option<u64> {
    let exif::Value::Ascii(texts) = &exif.get_field(Tag::DateTimeOriginal, In::PRIMARY)?.value else {
        return None;
    };
    let taken = exif::DateTime::from_ascii(texts.first()?).ok()?;
    let days = days_since_march_0000(
        u64::from(taken.year),
        u64::from(taken.month),
        u64::from(taken.day),
    );
    let whole =
        86_400 * days + 3600 * u64::from(taken.hour) + 60 * u64::from(taken.minute) + u64::from(taken.second);
    Some(whole)
}

/// Days of the Gregorian calendar, counted from a 1 March, so that leap days end a year.
fn days_since_march_0000(year: u64, month: u64, day: u64) -> u64 {
    let (year, month) = if month < 3 {
        (year.saturating_sub(1), month + 9)
    } else {
        (year, month - 3)
    };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day
}

/// A picture no longer than `longest_px`.
fn small(picture: &Picture, longest_px: usize) -> Result<Picture, cxx::Exception> {
    let longest = picture.width.max(picture.height);
    if longest <= longest_px {
        return Ok(picture.clone());
    }
    let scaled = |side: usize| ((side * longest_px + longest / 2) / longest).max(1);
    ffi::resized(picture, scaled(picture.width), scaled(picture.height))
}

fn rgb(picture: &Picture) -> RgbImage {
    Grid::from_fn(picture.width, picture.height, |column, row| {
        let at = 3 * (row * picture.width + column);
        [picture.rgb[at], picture.rgb[at + 1], picture.rgb[at + 2]].map(f32::from)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_by_value() {
        let mut names = ["f10.png", "f2.png", "a3_1.png", "f2b.png"];
        names.sort_by_key(|name| natural_key(name));
        assert_eq!(names, ["a3_1.png", "f2.png", "f2b.png", "f10.png"]);
    }

    /// A JPEG whose EXIF data say: taken with 26 mm at that second, to be turned by a quarter to the right.
    fn photo(file: &Path, second: u8) {
        let mut jpeg = Vec::new();
        let lying = image::RgbImage::from_fn(64, 48, |x, _| image::Rgb([if x < 32 { 250 } else { 5 }; 3]));
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 95)
            .encode_image(&lying)
            .unwrap();
        let taken = format!("2026:11:23 12:00:{second:02}").into_bytes();
        let fields = [
            (Tag::Orientation, exif::Value::Short(vec![6])),
            (Tag::FocalLengthIn35mmFilm, exif::Value::Short(vec![26])),
            (Tag::DateTimeOriginal, exif::Value::Ascii(vec![taken])),
        ]
        .map(|(tag, value)| exif::Field {
            tag,
            ifd_num: In::PRIMARY,
            value,
        });
        let mut writer = exif::experimental::Writer::new();
        fields.iter().for_each(|field| writer.push_field(field));
        let mut data = std::io::Cursor::new(Vec::new());
        writer.write(&mut data, false).unwrap();
        let segment = [b"Exif\0\0".to_vec(), data.into_inner()].concat();
        let length = (segment.len() as u16 + 2).to_be_bytes();
        let bytes = [&jpeg[..2], &[0xff, 0xe1], &length, &segment, &jpeg[2..]].concat();
        std::fs::write(file, bytes).unwrap();
    }

    #[test]
    fn portrait_photos_are_upright_in_the_order_of_their_taking_and_know_their_lens() {
        let folder = tempfile::tempdir().unwrap();
        photo(&folder.path().join("a.jpg"), 9);
        photo(&folder.path().join("b.jpg"), 4);
        let input = Input::find(folder.path()).unwrap();
        let photos = input.read(&PhotoOptions::default()).unwrap();
        let told: Vec<_> = photos.iter().map(|p| (p.name.as_str(), p.seconds)).collect();
        assert_eq!(told, [("b", Some(0.0)), ("a", Some(5.0))]);
        let photo = &photos[0];
        assert_eq!(photo.image.size(), (48, 64));
        // What lay left is up.
        assert!(photo.image[(24, 10)][0] > 200.0 && photo.image[(24, 54)][0] < 50.0);
        // The diagonal is 80 pixels.
        let expected = 26.0 / FILM_DIAGONAL_MM * 80.0;
        assert!((photo.focal_px.unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn of_each_group_the_sharpest_is_kept() {
        assert_eq!(sharpest(&[1.0, 3.0, 2.0, 5.0, 4.0, 0.0], 2), [1, 3]);
        assert_eq!(sharpest(&[1.0, 3.0], 5), [0, 1]);
        assert!(sharpest(&[], 5).is_empty());
    }

    #[test]
    fn days_go_on_across_months_leap_days_and_years() {
        let days = |y, m, d| days_since_march_0000(y, m, d);
        for ((y, m, d), (y2, m2, d2)) in [
            ((2024, 2, 29), (2024, 3, 1)),
            ((2023, 2, 28), (2023, 3, 1)),
            ((2023, 12, 31), (2024, 1, 1)),
            ((2024, 4, 30), (2024, 5, 1)),
        ] {
            assert_eq!(days(y, m, d) + 1, days(y2, m2, d2), "{y}-{m}-{d}");
        }
    }
}
