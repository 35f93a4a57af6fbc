//! Features on the object and which of them are alike.

use super::{MotionError, MotionOptions, View};
use crate::bridge::vision::ffi::{self, DetectOptions};
use rayon::prelude::*;

/// The object is looked at so large, in pixels, by magnifying small pictures.
const OBJECT_PX: f64 = 900.0;
/// Painted metal and glass have weak features; OpenCV's own threshold is 0.04.
const CONTRAST: f64 = 0.01;
const FEATURES: usize = 1200;
/// A match must be so much nearer than the second best.
const RATIO: f32 = 0.85;
/// A mask's border belongs to object and background: features so near to it (share of the object's size) do not count.
const BORDER: f64 = 0.01;

/// What frames have in common.
#[derive(serde::Serialize, serde::Deserialize)]
pub struct Matching {
    /// Per frame: where its features are.
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

/// Features on the object in every view, and their matches in pairs of views no further apart than `options.reach`.
///
/// `watch` hears of every pair, and how many there are; false stops.
///
/// # Errors
/// OpenCV's own.
pub fn match_features(
    views: &[View],
    options: &MotionOptions,
    watch: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Matching, MotionError> {
    let size = object_size(views);
    let found: Vec<(Vec<[f64; 2]>, Vec<f32>)> = views
        .par_iter()
        .map(|view| detect(view, (OBJECT_PX / size).clamp(1.0, 4.0), BORDER * size))
        .collect::<Result<_, _>>()?;
    let pairs: Vec<[usize; 2]> = (0..views.len())
        .flat_map(|a| (a + 1..views.len().min(a + 1 + options.reach)).map(move |b| [a, b]))
        .collect();
    let count = pairs.len();
    let pairs = pairs
        .into_par_iter()
        .map(|frames| {
            if !watch(count) {
                return Err(MotionError::Interrupted);
            }
            let [a, b] = frames.map(|frame| &found[frame].1);
            let matches = ffi::match_features(a, b, RATIO)?;
            Ok(Pair {
                frames,
                matches: matches.iter().map(|m| [m.a, m.b]).collect(),
            })
        })
        .collect::<Result<_, MotionError>>()?;
    Ok(Matching {
        features: found.into_iter().map(|(features, _)| features).collect(),
        pairs,
        pixel: size / 500.0,
    })
}

/// The diagonal of the median mask's box, in pixels.
fn object_size(views: &[View]) -> f64 {
    let mut sizes: Vec<f64> = views
        .iter()
        .filter_map(|view| view.mask.bounds())
        .map(|[left, top, right, bottom]| ((right - left) as f64).hypot((bottom - top) as f64))
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
}

fn detect(view: &View, zoom: f64, border: f64) -> Result<(Vec<[f64; 2]>, Vec<f32>), MotionError> {
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
        most: FEATURES,
    };
    let features = ffi::detect(&gray, &mask, width, height, &options, &mut descriptors)?;
    Ok((
        features.iter().map(|feature| [feature.x, feature.y]).collect(),
        descriptors,
    ))
}
