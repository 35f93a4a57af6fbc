//! From raw frames or a video to a sequence: frames, focal length, masks, camera motion and semi-dense depth.

mod cache;
mod depth;
mod enlarge;
mod error;
mod focal;
mod masks;
mod motion;
mod photos;
mod refine;
mod save;
mod stamp;
mod video;

pub use cache::Cache;
pub use depth::DepthOptions;
pub use error::PrepareError;
pub use focal::{Focal, FocalSource};
pub use masks::{MaskOptions, NetworkError, ObjectBox, masks_by_shape};
pub use motion::{MotionOptions, StructureFromMotionError};
pub use photos::{Input, PhotoOptions};
pub(crate) use photos::{Photo, Photos};
pub use refine::RefineOptions;
pub use save::{remove_stale, save};
pub use stamp::Stamp;

use crate::image::{DepthMap, Mask, RgbImage, halve_image, halve_mask};
use crate::report::{forget_peak_memory, peak_memory_mb};
use crate::sequence::{Frame, Sequence, SequenceContent};
use cache::Key;
use depth::ScaledFrames;
use motion::{FocalEvidence, MaskedImage, Motion};
use rayon::prelude::*;
use refine::Refined;
use std::path::Path;
use std::time::Instant;

/// Of the poses made here, in diagonals of the object: rendered ones are right to a sixth of a degree, and held more loosely than that
/// they get worse, as the prior has no shape that is just the object's.
const MOTION_DEVIATION: f64 = 0.001;

/// Options of [`prepare`], stage by stage.
#[derive(Clone, Debug, Default)]
pub struct PrepareOptions {
    /// Which frames are chosen, and their size.
    pub photos: PhotoOptions,
    /// The focal length, where the caller knows it; `None` takes EXIF data or finds it with the motion.
    pub focal: Option<Focal>,
    /// Where the masks come from.
    pub masks: MaskOptions,
    /// The search for the camera's motion.
    pub motion: MotionOptions,
    /// The plane sweep that gives depth.
    pub depth: DepthOptions,
    /// The adjustment of motion and depth after the sweep.
    pub refine: RefineOptions,
}

/// The sequence made of an input, and how it was made.
pub struct Prepared {
    /// The frames that could be placed.
    pub sequence: Sequence,
    /// The stages in order, with what each did.
    pub stages: Vec<StageReport>,
}

/// What a stage did.
#[derive(Clone, Debug)]
pub struct StageReport {
    /// The stage: `frames`, `masks`, `motion` …
    pub name: &'static str,
    /// Counts and what to know, for people.
    pub words: String,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// The most memory that the process used, MB (10⁶ bytes); `None` where the system does not tell.
    pub peak_memory_mb: Option<f64>,
}

/// Sees a stage under way: its name, how many steps it has, and each one done. False stops.
pub type ProgressCallback<'a> = dyn Fn(&'static str, usize) -> bool + Sync + 'a;

/// What is to be done, the stages that are done, and when the one under way began.
struct Preparation<'a> {
    options: &'a PrepareOptions,
    cache: &'a Cache,
    watch: &'a ProgressCallback<'a>,
    stages: Vec<StageReport>,
    began: Instant,
}

impl Preparation<'_> {
    /// What the stage under way did; the next one begins.
    fn end(&mut self, name: &'static str, words: String) {
        self.stages.push(StageReport {
            name,
            words,
            seconds: self.began.elapsed().as_secs_f64(),
            peak_memory_mb: peak_memory_mb(),
        });
        self.began = Instant::now();
        forget_peak_memory();
    }

    /// The photos in which the object was found, and its masks.
    fn with_object(&mut self, photos: Vec<Photo>, key: Key) -> Result<(Vec<Photo>, Vec<Mask>), PrepareError> {
        let masks::Found { masks, words } =
            masks::masks(&photos, &self.options.masks, self.cache, key, &|steps| {
                (self.watch)("masks", steps)
            })?;
        let count = photos.len();
        let (with_object, without): (Vec<_>, Vec<_>) = photos
            .into_iter()
            .zip(masks)
            .partition(|(_, mask)| mask.is_some());
        let (photos, masks): (Vec<Photo>, Vec<Mask>) = with_object
            .into_iter()
            .filter_map(|(photo, mask)| Some((photo, mask?)))
            .unzip();
        let without: Vec<&str> = without.iter().map(|(photo, _)| photo.name.as_str()).collect();
        if photos.len() < 2 {
            return Err(PrepareError::NoObject {
                found: photos.len(),
                frames: count,
            });
        }
        let share = masks.iter().map(Mask::share).sum::<f64>() / masks.len() as f64;
        let mut words = format!("{words}, {:.0} % of a picture", 100.0 * share);
        if !without.is_empty() {
            words += &format!("; dropped, no object found: {}", without.join(", "));
        }
        self.end("masks", words);
        Ok((photos, masks))
    }

    /// The best motion of those that start from candidate focal lengths, until one has all frames, and what was known of the focal length before.
    fn moved(
        &self,
        photos: &[Photo],
        masks: &[Mask],
        key: Key,
    ) -> Result<(Motion, Option<FocalEvidence>, FocalSource), PrepareError> {
        let (options, cache, watch) = (self.options, self.cache, self.watch);
        let (cameras, focal_source) = focal::cameras(photos, options.focal)?;
        let motion_options = MotionOptions {
            focal_deviation: focal_source.deviation(),
            ..options.motion.clone()
        };
        let motion = cache.get_or("motion", key, || {
            let matching = cache.get_or("matches", key, || {
                let views: Vec<MaskedImage> = photos
                    .iter()
                    .zip(masks)
                    .map(|(photo, mask)| MaskedImage {
                        image: &photo.image,
                        mask,
                    })
                    .collect();
                motion::match_features(&views, &|pairs| watch("matches", pairs))
            })?;
            let mut best: Option<Motion> = None;
            let mut failure = StructureFromMotionError::NoPair { matched: 0 };
            for camera in &cameras {
                if !watch("motion", cameras.len()) {
                    return Err(StructureFromMotionError::Interrupted);
                }
                match motion::motion(&matching, camera, &motion_options) {
                    Ok(found) => {
                        let is_whole = found.is_whole();
                        if best.as_ref().is_none_or(|best| found.score() > best.score()) {
                            best = Some(found);
                        }
                        if is_whole {
                            break;
                        }
                    }
                    Err(error) => failure = error,
                }
            }
            best.ok_or(failure)
        })?;
        let known = (focal_source != FocalSource::Refined).then(|| FocalEvidence {
            px: cameras.first().map_or(motion.camera.fx, |camera| camera.fx),
            deviation: focal_source.deviation(),
        });
        Ok((motion, known, focal_source))
    }

    /// Depth by a plane sweep, and poses and depth after their refinement.
    fn refined(
        &mut self,
        photos: &[Photo],
        masks: &[Mask],
        motion: &Motion,
        key: Key,
    ) -> Result<Refined, PrepareError> {
        let (options, watch) = (self.options, self.watch);
        let placed = motion.camera_from_input.iter().flatten().count();
        let neighbours = depth::neighbours(motion, options.depth.neighbours);
        let full = ScaledFrames {
            images: photos.iter().map(|photo| &photo.image).zip(masks).collect(),
            camera: motion.camera,
        };
        let halvings = depth::halvings(motion::object_size(masks.iter()));
        let halved: Vec<Option<(RgbImage, Mask)>> = full
            .images
            .par_iter()
            .map(|(image, mask)| {
                (0..halvings).fold(None, |last: Option<(RgbImage, Mask)>, _| {
                    let (image, mask) = last
                        .as_ref()
                        .map_or((*image, *mask), |(image, mask)| (image, mask));
                    Some((halve_image(image), halve_mask(mask)))
                })
            })
            .collect();
        let scale = 0.5f64.powi(halvings as i32);
        let small = ScaledFrames {
            images: full
                .images
                .iter()
                .zip(&halved)
                .map(|(whole, halved)| halved.as_ref().map_or(*whole, |(image, mask)| (image, mask)))
                .collect(),
            camera: motion.camera.scaled(scale, scale),
        };
        let depths = self.cache.get_or("depth", key, || {
            depth::sweep(&small, motion, &neighbours, &options.depth, &|| {
                watch("depth", placed)
            })
            .ok_or(PrepareError::Interrupted)
        })?;
        self.end(
            "depth",
            format!(
                "{:.1} % of the masks",
                100.0 * known_share(&depths, small.images.iter().map(|(_, mask)| *mask))
            ),
        );
        let refined = self.cache.get_or("refined", key.and(&options.refine), || {
            refine::refine(
                &full,
                (&small, halvings),
                motion,
                &depths,
                &neighbours,
                &options.refine,
                &|| watch("refinement", placed + 1),
            )?
            .ok_or(PrepareError::Interrupted)
        })?;
        self.end(
            "refinement",
            format!(
                "poses and depth by what pixels look like: {:.1} % of the masks left",
                100.0 * known_share(&refined.depths, masks.iter())
            ),
        );
        Ok(refined)
    }
}

/// Makes a sequence of a video or a folder of pictures. What `cache` holds of earlier runs is not made again.
///
/// # Errors
/// An input that cannot be read, no object, or too little in common between frames.
pub fn prepare(
    input: &Path,
    options: &PrepareOptions,
    cache: &Cache,
    watch: &ProgressCallback,
) -> Result<Prepared, PrepareError> {
    check(options)?;
    forget_peak_memory();
    let mut preparation = Preparation {
        options,
        cache,
        watch,
        stages: Vec::new(),
        began: Instant::now(),
    };
    let found = Input::find(input)?;
    let key = stamp::contents(&found.files())?.and(&options.photos);
    let Photos { photos, notes } = found.read(&options.photos)?;
    let (width, height) = photos.first().map_or((0, 0), |photo| photo.image.size());
    let notes: String = notes.iter().map(|note| format!("; {note}")).collect();
    preparation.end("frames", format!("{} of {width} × {height}{notes}", photos.len()));

    let (photos, masks) = preparation.with_object(photos, key)?;
    let contents: Vec<&[bool]> = masks.iter().map(Mask::data).collect();
    let key = Key::of(&(key, contents)).and(&options.motion).and(&options.focal);
    let (motion, known_focal, focal_source) = preparation.moved(&photos, &masks, key)?;
    preparation.end(
        "motion",
        motion_in_words(&photos, &motion, &focal_source.say(&motion, known_focal)),
    );
    let key = key.and(&options.depth);
    let refined = preparation.refined(&photos, &masks, &motion, key)?;
    let name = input
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    Ok(Prepared {
        sequence: sequence_of(name, photos, masks, &motion, refined)?,
        stages: preparation.stages,
    })
}

fn check(options: &PrepareOptions) -> Result<(), PrepareError> {
    for (option, value, least, mend) in [
        ("--max-frames", options.photos.max_frames, 2, "give 2 or more"),
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
    Ok(())
}

/// What the motion stage found. `focal` says the same of the focal length.
fn motion_in_words(photos: &[Photo], motion: &Motion, focal: &str) -> String {
    let placed = motion.camera_from_input.iter().flatten().count();
    let lost: Vec<&str> = photos
        .iter()
        .zip(&motion.camera_from_input)
        .filter(|(_, pose)| pose.is_none())
        .map(|(photo, _)| photo.name.as_str())
        .collect();
    let mut words = format!(
        "{placed} of {} frames placed, {} points, {:.2} px; {focal}",
        photos.len(),
        motion.points.len(),
        motion.error_px,
    );
    if !lost.is_empty() {
        words += &format!(
            "; dropped, too little in common with the others: {}",
            lost.join(", ")
        );
    }
    if placed < lost.len() {
        words += ", IN DOUBT: most frames are lost; give pictures that are nearer to each other";
    }
    if motion.may_be_swapped {
        words += ", IN DOUBT: near and far may be swapped; give pictures from nearer, from more sides, or --focal if you know it";
    }
    words
}

/// The frames that were placed.
fn sequence_of(
    name: String,
    photos: Vec<Photo>,
    masks: Vec<Mask>,
    motion: &Motion,
    refined: Refined,
) -> Result<Sequence, PrepareError> {
    let frames = photos
        .into_iter()
        .zip(masks)
        .zip(refined.camera_from_input)
        .zip(refined.depths.into_iter().zip(refined.deviations))
        .filter_map(|(((photo, mask), pose), (depth, depth_deviation))| {
            Some(Frame {
                name: photo.name,
                image: photo.image.into(),
                mask,
                camera: motion.camera,
                timestamp_s: photo.seconds,
                camera_from_input: Some(pose?),
                depth,
                depth_deviation,
            })
        })
        .collect();
    Ok(Sequence::new(SequenceContent {
        name,
        frames,
        motion_deviation: Some(MOTION_DEVIATION),
        focal_deviation: Some(motion.focal_deviation).filter(|&deviation| deviation > 0.0),
        truth: None,
    })?)
}

/// Pixels with depth over all pixels, of the masks of placed frames.
fn known_share<'a>(depths: &[Option<DepthMap>], masks: impl Iterator<Item = &'a Mask>) -> f64 {
    let (mut known, mut all) = (0, 0);
    for (depth, mask) in depths
        .iter()
        .zip(masks)
        .filter_map(|(depth, mask)| Some((depth.as_ref()?, mask)))
    {
        known += depth.data().iter().filter(|&&z| z > 0.0).count();
        all += mask.data().iter().filter(|&&inside| inside).count();
    }
    known as f64 / all.max(1) as f64
}
