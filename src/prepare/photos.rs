//! Frames out of a video or a folder of photos: upright, in order, of one size, and no more than are needed.

use super::PrepareError;
use super::video::video;
use crate::bridge::vision::ffi::{self, Picture};
use crate::image::{Grid, ImageError, PictureFile, Pictures, RgbImage, Turn, colours, exif_data};
use crate::memory::memory_bytes;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What all stages take a pixel of a chosen frame.
const BYTES_PER_PIXEL: f64 = 150.0;

/// Which frames are chosen, and their size.
#[derive(Clone, Debug)]
pub struct PhotoOptions {
    /// The maximum number of frames. The frames in order are cut into as many groups, and of each group the sharpest is kept.
    pub max_frames: usize,
    /// The longer side of what comes out, in pixels; smaller pictures stay as they are.
    pub longest_px: usize,
}

impl Default for PhotoOptions {
    fn default() -> Self {
        Self {
            max_frames: 40,
            longest_px: 960,
        }
    }
}

/// A video or a list of pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// A video file.
    Video(PathBuf),
    /// Pictures of a folder.
    Photos {
        /// The pictures, sorted by name, with numbers in names compared by value.
        files: Vec<PathBuf>,
        /// Pictures beside them that are not read, in words.
        left_out: Option<String>,
    },
}

/// A frame that was chosen, upright and at its working size.
#[derive(Clone, Debug)]
pub struct Photo {
    /// A photo's name, without its ending where all stay apart, or a frame's number in its video.
    pub name: String,
    pub image: RgbImage,
    /// Since the video's first frame or the first photo, where known.
    pub seconds: Option<f64>,
    /// The focal length in pixels of `image` that a photo's EXIF data give.
    pub focal_px: Option<f64>,
    /// The image's size over that of the original.
    pub scale: f64,
    pub origin: Origin,
}

/// What a frame was before it was turned upright.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    Video,
    /// A picture that was stored to be turned so.
    File(Turn),
}

/// The chosen frames.
#[derive(Debug)]
pub struct Photos {
    pub photos: Vec<Photo>,
    /// What to know of them, for people.
    pub notes: Vec<String>,
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
        let pictures = Pictures::of(path)?;
        let left_out = pictures.left_out();
        if pictures.files.is_empty() && left_out.is_none() {
            return Err(PrepareError::NoPictures(path.to_owned()));
        }
        if pictures.files.len() < 2 {
            return Err(PrepareError::TooFew {
                input: path.to_owned(),
                found: pictures.files.len(),
                mend: match left_out {
                    Some(left_out) => format!("left out are {left_out}"),
                    None => "give more pictures of the object, or a video".into(),
                },
            });
        }
        Ok(Self::Photos {
            files: pictures.files,
            left_out,
        })
    }

    /// All files it is made of.
    pub fn files(&self) -> Vec<PathBuf> {
        match self {
            Self::Video(file) => vec![file.clone()],
            Self::Photos { files, .. } => files.clone(),
        }
    }

    /// The chosen frames.
    ///
    /// # Errors
    /// Pictures that cannot be read, of different sizes, too few frames, or more than memory can hold.
    pub fn read(&self, options: &PhotoOptions) -> Result<Photos, PrepareError> {
        match self {
            Self::Video(file) => video(file, options),
            Self::Photos { files, left_out } => Ok(Photos {
                photos: photos(files, options)?,
                notes: left_out
                    .iter()
                    .map(|words| format!("left out are {words}"))
                    .collect(),
            }),
        }
    }
}

/// Fails where frames of that size take more memory than there is.
pub(super) fn check_memory(frames: usize, (width, height): (usize, usize)) -> Result<(), PrepareError> {
    let needed = frames as f64 * width as f64 * height as f64 * BYTES_PER_PIXEL;
    match memory_bytes() {
        Some(there) if needed > there => Err(PrepareError::Option {
            option: "--max-frames, --max-size",
            problem: format!(
                "{frames} frames of {width} × {height} take about {:.1} GB of memory, this machine has {:.1}",
                needed / 1e9,
                there / 1e9
            ),
            mend: "give less of either",
        }),
        _ => Ok(()),
    }
}

/// The sharpest of each of `most` groups of frames in a row, in order.
pub(super) fn sharpest(sharpness: &[f64], max_frames: usize) -> Vec<usize> {
    let groups = sharpness.len().min(max_frames);
    (0..groups)
        .filter_map(|group| {
            let range = group * sharpness.len() / groups..(group + 1) * sharpness.len() / groups;
            range.max_by(|&a, &b| sharpness[a].total_cmp(&sharpness[b]))
        })
        .collect()
}

/// What is looked at of every photo before some are chosen; thousands of pictures would not fit into memory.
struct Seen<'a> {
    file: &'a Path,
    size: (usize, usize),
    focal_px: Option<f64>,
    /// Whole seconds of a calendar.
    seconds: Option<u64>,
    sharpness: f64,
}

fn photos(files: &[PathBuf], options: &PhotoOptions) -> Result<Vec<Photo>, PrepareError> {
    let mut seen: Vec<Seen> = files
        .par_iter()
        .map(|file| look(file, options.longest_px))
        .collect::<Result<_, PrepareError>>()?;
    // Cameras start their numbers anew; within a second, names decide.
    if seen.iter().all(|photo| photo.seconds.is_some()) {
        seen.sort_by_key(|photo| photo.seconds);
    }
    let count = |size: (usize, usize)| seen.iter().filter(|photo| photo.size == size).count();
    let usual = seen
        .iter()
        .map(|photo| photo.size)
        .max_by_key(|&size| count(size));
    let expected = usual.unwrap_or_default();
    if let Some(odd) = seen.iter().find(|photo| photo.size != expected) {
        return Err(PrepareError::MixedSizes {
            file: odd.file.to_owned(),
            found: odd.size,
            expected,
        });
    }
    let sharpness: Vec<f64> = seen.iter().map(|photo| photo.sharpness).collect();
    let first = seen.iter().find_map(|photo| photo.seconds);
    let names = names(&seen);
    let chosen = sharpest(&sharpness, options.max_frames);
    check_memory(chosen.len(), expected)?;
    chosen
        .into_par_iter()
        .map(|index| {
            let photo = &seen[index];
            let (turn, whole) = read(photo.file)?;
            let picture = small(&whole, options.longest_px)?;
            Ok(Photo {
                name: names[index].clone(),
                image: image_of(&picture),
                seconds: photo
                    .seconds
                    .zip(first)
                    .map(|(seconds, first)| seconds.abs_diff(first) as f64),
                focal_px: photo.focal_px,
                scale: picture.width as f64 / whole.width as f64,
                origin: Origin::File(turn),
            })
        })
        .collect()
}

/// Names of photos: without their endings where that keeps them apart.
fn names(seen: &[Seen]) -> Vec<String> {
    let lossy = |name: Option<&std::ffi::OsStr>| name.unwrap_or_default().to_string_lossy().into_owned();
    let stems: Vec<String> = seen.iter().map(|photo| lossy(photo.file.file_stem())).collect();
    if stems.iter().collect::<BTreeSet<_>>().len() == stems.len() {
        return stems;
    }
    seen.iter().map(|photo| lossy(photo.file.file_name())).collect()
}

fn look(file: &Path, longest_px: usize) -> Result<Seen<'_>, PrepareError> {
    let bytes = std::fs::read(file).map_err(|error| ImageError::read(file, error))?;
    let picture = small(&decode(&bytes, file)?.1, longest_px)?;
    let exif = exif_data::read(&bytes);
    Ok(Seen {
        file,
        size: (picture.width, picture.height),
        focal_px: exif
            .as_ref()
            .and_then(|exif| exif_data::focal_px(exif, picture.width, picture.height)),
        seconds: exif.as_ref().and_then(exif_data::seconds),
        sharpness: ffi::sharpness(&small(&picture, 320)?)?,
    })
}

fn read(file: &Path) -> Result<(Turn, Picture), ImageError> {
    let bytes = std::fs::read(file).map_err(|error| ImageError::read(file, error))?;
    decode(&bytes, file)
}

/// A picture upright, and how it was turned.
fn decode(bytes: &[u8], file: &Path) -> Result<(Turn, Picture), ImageError> {
    let picture = PictureFile::decode(bytes).map_err(|reason| ImageError::Decode {
        file: file.to_owned(),
        reason,
    })?;
    let turn = picture.turn;
    let pixels = colours(picture.upright());
    let picture = Picture {
        width: pixels.width() as usize,
        height: pixels.height() as usize,
        rgb: pixels.into_raw(),
        seconds: 0.0,
    };
    Ok((turn, picture))
}

/// A picture no longer than `longest_px`.
pub(super) fn small(picture: &Picture, longest_px: usize) -> Result<Picture, cxx::Exception> {
    let longest = picture.width.max(picture.height);
    if longest <= longest_px {
        return Ok(picture.clone());
    }
    let scaled = |side: usize| ((side * longest_px + longest / 2) / longest).max(1);
    ffi::resized(picture, scaled(picture.width), scaled(picture.height))
}

pub(super) fn image_of(picture: &Picture) -> RgbImage {
    Grid::from_fn(picture.width, picture.height, |column, row| {
        let at = 3 * (row * picture.width + column);
        [picture.rgb[at], picture.rgb[at + 1], picture.rgb[at + 2]].map(f32::from)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::exif_data::FILM_DIAGONAL_MM;
    use crate::image::exif_jpeg;
    use exif::{Tag, Value};

    /// A JPEG whose EXIF data say: taken with 26 mm at that second, to be turned by a quarter to the right.
    fn photo(file: &Path, second: u8) {
        let taken = format!("2026:11:23 12:00:{second:02}").into_bytes();
        let bytes = exif_jpeg(
            (64, 48),
            &[
                (Tag::Orientation, Value::Short(vec![6])),
                (Tag::FocalLengthIn35mmFilm, Value::Short(vec![26])),
                (Tag::DateTimeOriginal, Value::Ascii(vec![taken])),
            ],
        );
        std::fs::write(file, bytes).unwrap();
    }

    #[test]
    fn portrait_photos_are_upright_in_the_order_of_their_taking_and_know_their_lens() {
        let folder = tempfile::tempdir().unwrap();
        photo(&folder.path().join("a.jpg"), 9);
        photo(&folder.path().join("b.jpg"), 4);
        std::fs::write(folder.path().join("c.HEIC"), "").unwrap();
        let input = Input::find(folder.path()).unwrap();
        let Photos { photos, notes } = input.read(&PhotoOptions::default()).unwrap();
        assert!(notes[0].contains("1 .heic") && notes.len() == 1, "{notes:?}");
        let told: Vec<_> = photos.iter().map(|p| (p.name.as_str(), p.seconds)).collect();
        assert_eq!(told, [("b", Some(0.0)), ("a", Some(5.0))]);
        let photo = &photos[0];
        assert_eq!(photo.image.size(), (48, 64));
        assert!(matches!(photo.origin, Origin::File(turn) if turn.swaps_sides()));
        // What lay left is up.
        assert!(photo.image[(24, 10)][0] > 200.0 && photo.image[(24, 54)][0] < 50.0);
        // The diagonal is 80 pixels.
        let expected = 26.0 / FILM_DIAGONAL_MM * 80.0;
        assert!((photo.focal_px.unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn photos_that_differ_in_their_endings_keep_them() {
        let folder = tempfile::tempdir().unwrap();
        photo(&folder.path().join("a.jpg"), 1);
        photo(&folder.path().join("a.jpeg"), 2);
        let photos = Input::find(folder.path())
            .unwrap()
            .read(&PhotoOptions::default())
            .unwrap()
            .photos;
        assert_eq!([&photos[0].name, &photos[1].name], ["a.jpg", "a.jpeg"]);
    }

    #[test]
    fn of_each_group_the_sharpest_is_kept() {
        assert_eq!(sharpest(&[1.0, 3.0, 2.0, 5.0, 4.0, 0.0], 2), [1, 3]);
        assert_eq!(sharpest(&[1.0, 3.0], 5), [0, 1]);
        assert!(sharpest(&[], 5).is_empty());
    }

    #[test]
    fn more_than_memory_holds_is_refused_before_it_is_read() {
        assert!(check_memory(40, (960, 720)).is_ok());
        let message = check_memory(100_000, (12_000, 9_000)).unwrap_err().to_string();
        assert!(message.contains("--max-size: 100000 frames"), "{message}");
    }
}
