//! Features on the object and which of them are alike.

use super::alike::{ENTRIES, alike};
use super::{MaskedImage, StructureFromMotionError};
use crate::bridge::vision::ffi::{self, DetectOptions};
use crate::image::Mask;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// The object is looked at so large, in pixels, by magnifying small pictures.
const OBJECT_PX: f64 = 900.0;
/// Painted metal and glass have weak features; OpenCV's own threshold is 0.04.
const CONTRAST: f64 = 0.01;
const FEATURES: usize = 1200;
/// A match must be so much nearer than the second best.
const RATIO: f32 = 0.85;
/// So many frames after one are always matched with it.
const WINDOW: usize = 6;
/// Of frames further apart, so many of the strongest features are looked at first. On epfl_04, 10 and 16, pairs that pass hold 95 % of the
/// matches that fit a motion.
const STRONGEST: usize = 300;
/// Their matches must be clearer than others,
const STRONGEST_RATIO: f32 = 0.75;
/// and as many as this.
const STRONGEST_ALIKE: usize = 4;
/// A mask's border belongs to object and background: features so near to it (share of the object's size) do not count.
const BORDER: f64 = 0.01;

/// What frames have in common.
#[derive(serde::Serialize, serde::Deserialize)]
pub struct Matching {
    /// The positions (x, y) of every frame's features, pixels.
    pub features: Vec<Vec<[f64; 2]>>,
    /// Frame pairs a < b, and which features of theirs are alike.
    pub pairs: Vec<Pair>,
    /// Pixels per unit of error: of an object 500 pixels across it is 1.
    pub pixel: f64,
}

/// Two frames and which features of theirs are alike.
#[derive(serde::Serialize, serde::Deserialize)]
pub struct Pair {
    pub frames: [usize; 2],
    pub matches: Vec<[u32; 2]>,
}

/// Features on the object in every view, and their matches in pairs of views: those near in time, and those far apart, as where a turn
/// comes round, whose strongest features look alike.
///
/// `watch` hears of every pair, and how many there are; false stops.
///
/// # Errors
/// An exception of OpenCV, or an interruption.
pub fn match_features(
    views: &[MaskedImage],
    watch: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Matching, StructureFromMotionError> {
    let size = object_size(views.iter().map(|view| view.mask));
    let found: Vec<(Vec<[f64; 2]>, DMatrix<f32>)> = views
        .par_iter()
        .map(|view| detect(view, (OBJECT_PX / size).clamp(1.0, 4.0), BORDER * size))
        .collect::<Result<_, _>>()?;
    let pairs: Vec<[usize; 2]> = (0..views.len())
        .flat_map(|a| (a + 1..views.len()).map(move |b| [a, b]))
        .collect();
    let count = pairs.len();
    let pairs = pairs
        .into_par_iter()
        .map(|frames| {
            if !watch(count) {
                return Err(StructureFromMotionError::Interrupted);
            }
            let [a, b] = frames.map(|frame| &found[frame].1);
            let matches = if likely(frames, a, b) {
                alike(a, b, RATIO)
            } else {
                Vec::new()
            };
            Ok(Pair { frames, matches })
        })
        .collect::<Result<_, StructureFromMotionError>>()?;
    Ok(Matching {
        features: found.into_iter().map(|(features, _)| features).collect(),
        pairs,
        pixel: size / 500.0,
    })
}

/// Whether two frames may have enough in common to be worth a match of all their features.
fn likely([a, b]: [usize; 2], features_a: &DMatrix<f32>, features_b: &DMatrix<f32>) -> bool {
    let strongest =
        |features: &DMatrix<f32>| features.columns(0, STRONGEST.min(features.ncols())).into_owned();
    b - a <= WINDOW
        || alike(&strongest(features_a), &strongest(features_b), STRONGEST_RATIO).len() >= STRONGEST_ALIKE
}

/// The diagonal of the median mask's box, in pixels.
pub fn object_size<'a>(masks: impl Iterator<Item = &'a Mask>) -> f64 {
    let mut sizes: Vec<f64> = masks
        .filter_map(Mask::bounds)
        .map(|[left, top, right, bottom]| ((right - left) as f64).hypot((bottom - top) as f64))
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
}

/// Where features are, and a column each that describes them.
fn detect(
    view: &MaskedImage,
    zoom: f64,
    border: f64,
) -> Result<(Vec<[f64; 2]>, DMatrix<f32>), StructureFromMotionError> {
    let (width, height) = view.image.size();
    let gray: Vec<u8> = view
        .image
        .data()
        .iter()
        .map(|[r, g, b]| (0.299 * r + 0.587 * g + 0.114 * b).round() as u8)
        .collect();
    let mut mask: Vec<u8> = view.mask.data().iter().map(|&inside| u8::from(inside)).collect();
    ffi::grow(&mut mask, width, height, -(border.round() as i32))?;
    let mut descriptors = Vec::new();
    let options = DetectOptions {
        zoom,
        contrast: CONTRAST,
        max_features: FEATURES,
    };
    let features = ffi::detect(&gray, &mask, width, height, &options, &mut descriptors)?;
    Ok((
        features.iter().map(|feature| [feature.x, feature.y]).collect(),
        DMatrix::from_vec(ENTRIES, features.len(), descriptors),
    ))
}
