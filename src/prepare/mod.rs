//! From raw frames or a video to a sequence: frames, focal length, masks, camera motion and semi-dense depth.

mod depth;
mod error;
mod focal;
mod masks;
pub mod motion;
mod photos;
mod stamp;

pub use depth::DepthOptions;
pub use error::PrepareError;
pub use focal::{Focal, FocalSource};
pub use masks::{MaskOptions, MaskSource, ObjectBox};
pub use motion::MotionOptions;
pub use photos::{Input, Photo, PhotoOptions};
pub use stamp::Stamp;

use crate::image::{Grid, Mask, read_mask};
use crate::sequence::{Frame, Sequence};
use motion::{Motion, View};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What can be chosen.
#[derive(Clone, Debug, Default)]
pub struct PrepareOptions {
    pub photos: PhotoOptions,
    pub focal: Option<Focal>,
    pub masks: MaskOptions,
    /// Folder of masks (white = object), named like the pictures.
    pub given_masks: Option<PathBuf>,
    pub motion: MotionOptions,
    pub depth: DepthOptions,
}

/// What became of an input.
pub struct Prepared {
    /// The frames that could be placed.
    pub sequence: Sequence,
    /// One per stage.
    pub stages: Vec<Stage>,
}

/// What a stage did.
#[derive(Clone, Debug)]
pub struct Stage {
    pub name: &'static str,
    /// Counts and what to know, for people.
    pub words: String,
    pub seconds: f64,
}

/// Sees a stage under way: its name, how many steps it has, and each one done. False stops.
pub type Watch<'a> = dyn Fn(&'static str, usize) -> bool + Sync + 'a;

/// Makes a sequence of a video or a folder of pictures.
///
/// # Errors
/// An input that cannot be read, no object, or too little in common between frames.
pub fn prepare(input: &Path, options: &PrepareOptions, watch: &Watch) -> Result<Prepared, PrepareError> {
    for (option, value, least, mend) in [
        ("--max-frames", options.photos.most, 2, "give 2 or more"),
        ("--max-size", options.photos.longest_px, 64, "give 64 or more"),
    ] {
        if value < least {
            return Err(PrepareError::Option {
                option,
                problem: format!("{value} is too few"),
                mend,
            });
        }
    }
    let mut stages = Vec::new();
    let mut began = Instant::now();
    let mut stage = |name, words: String| {
        let seconds = began.elapsed().as_secs_f64();
        began = Instant::now();
        stages.push(Stage { name, words, seconds });
    };
    let photos = Input::find(input)?.read(&options.photos)?;
    let (width, height) = photos.first().map_or((0, 0), |photo| photo.image.size());
    stage("frames", format!("{} of {width} × {height}", photos.len()));

    let (masks, source) = match &options.given_masks {
        Some(folder) => (given_masks(folder, &photos)?, MaskSource::Given),
        None => masks::masks(&photos, &options.masks, &|| watch("masks", photos.len()))?,
    };
    let share = masks.iter().map(Mask::share).sum::<f64>() / masks.len().max(1) as f64;
    stage(
        "masks",
        format!("{}, {:.0} % of a picture", source.words(), 100.0 * share),
    );

    let (cameras, focal_source) = focal::cameras(&photos, options.focal)?;
    let views: Vec<View> = photos
        .iter()
        .zip(&masks)
        .map(|(photo, mask)| View {
            image: &photo.image,
            mask,
        })
        .collect();
    let matching = motion::match_features(&views, &options.motion, &|pairs| watch("matches", pairs))?;
    let mut best: Option<Motion> = None;
    let motion_options = MotionOptions {
        focal_deviation: focal_source.deviation(),
        ..options.motion.clone()
    };
    let mut failure = None;
    for camera in &cameras {
        if !watch("motion", cameras.len()) {
            return Err(PrepareError::Interrupted);
        }
        match motion::motion(&matching, camera, &motion_options) {
            Ok(found) => {
                if best.as_ref().is_none_or(|best| worth(&found) > worth(best)) {
                    best = Some(found);
                }
            }
            Err(error) => failure = Some(error),
        }
    }
    let motion = match (best, failure) {
        (Some(best), _) => best,
        (None, Some(error)) => return Err(error.into()),
        (None, None) => return Err(motion::MotionError::NoPair { matched: 0 }.into()),
    };
    let placed = motion.camera_from_input.iter().flatten().count();
    let lost: Vec<&str> = photos
        .iter()
        .zip(&motion.camera_from_input)
        .filter(|(_, pose)| pose.is_none())
        .map(|(photo, _)| photo.name.as_str())
        .collect();
    let mut words = format!(
        "{placed} of {} frames placed, {} points, {:.2} px; focal length {:.0} px {}",
        photos.len(),
        motion.points.len(),
        motion.error_px,
        motion.camera.fx,
        focal_source.words()
    );
    if !lost.is_empty() {
        words += &format!("; too little in common with the others: {}", lost.join(", "));
    }
    stage("motion", words);

    let images: Vec<_> = photos
        .iter()
        .zip(&masks)
        .map(|(photo, mask)| (&photo.image, mask))
        .collect();
    let depths = depth::sweep(&images, &motion, &options.depth, &|| watch("depth", placed))
        .ok_or(PrepareError::Interrupted)?;
    let (mut known, mut all) = (0, 0);
    for (depth, mask) in depths
        .iter()
        .zip(&masks)
        .filter_map(|(depth, mask)| Some((depth.as_ref()?, mask)))
    {
        known += depth.data().iter().filter(|&&z| z > 0.0).count();
        all += mask.data().iter().filter(|&&inside| inside).count();
    }
    stage(
        "depth",
        format!("{:.1} % of the masks", 100.0 * known as f64 / all.max(1) as f64),
    );

    let frames = photos
        .into_iter()
        .zip(masks)
        .zip(motion.camera_from_input.iter().zip(depths))
        .filter_map(|((photo, mask), (pose, depth))| {
            Some(Frame {
                name: photo.name,
                image: photo.image,
                mask,
                camera: motion.camera,
                timestamp_s: photo.seconds,
                camera_from_input: Some((*pose)?),
                depth,
            })
        })
        .collect();
    let name = input
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    Ok(Prepared {
        sequence: Sequence {
            name,
            frames,
            truth: None,
        },
        stages,
    })
}

/// More points seen from more frames are worth more; an error costs.
fn worth(motion: &Motion) -> f64 {
    let observations: usize = motion.seen_in.iter().map(Vec::len).sum();
    observations as f64 / (0.5 + motion.error_px)
}

/// A picture's mask has its name, with or without the picture's own ending: `a.png` or `a.jpg.png` for `a.jpg`.
fn given_masks(folder: &Path, photos: &[Photo]) -> Result<Vec<Mask>, PrepareError> {
    let entries = std::fs::read_dir(folder).map_err(|source| PrepareError::Read {
        file: folder.to_owned(),
        source,
    })?;
    let files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    let mask = |photo: &Photo| {
        let belongs = |file: &&PathBuf| {
            let stem = file.file_stem().map(Path::new);
            let name = Some(std::ffi::OsStr::new(&photo.name));
            stem.map(Path::as_os_str) == name || stem.and_then(Path::file_stem) == name
        };
        let named = folder.join(format!("{}.png", photo.name));
        let mask = read_mask(files.iter().filter(belongs).min().unwrap_or(&named))?;
        let (width, height) = photo.image.size();
        // Pictures may have been made smaller than their masks.
        let at = |x: usize, to: usize, from: usize| (x * from + from / 2) / to;
        Ok(Grid::from_fn(width, height, |column, row| {
            mask[(at(column, width, mask.width()), at(row, height, mask.height()))]
        }))
    };
    photos.iter().map(mask).collect()
}
