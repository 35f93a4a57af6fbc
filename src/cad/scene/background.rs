//! The backdrop: a photograph, or three octaves of blotches in each colour.

use super::super::CadError;
use super::super::random::{blotches, hash};
use super::{Scene, stream};
use crate::image::{Grid, RgbImage, read_rgb_covering};

/// RGB in \[0, 255\], of the camera's size, the same for every frame.
pub(super) fn paint(scene: &Scene) -> Result<RgbImage, CadError> {
    let (width, height) = (scene.camera.width_px, scene.camera.height_px);
    match &scene.background.image {
        Some(file) => read_rgb_covering(file, width, height).map_err(|error| CadError::Scene {
            field: "background.image",
            problem: error.to_string(),
        }),
        None => Ok(blotchy(scene)),
    }
}

fn blotchy(scene: &Scene) -> RgbImage {
    let background = &scene.background;
    let key = hash(hash(scene.seed) ^ stream::BACKGROUND);
    Grid::from_fn(scene.camera.width_px, scene.camera.height_px, |column, row| {
        std::array::from_fn(|channel| {
            let sum: f64 = (0u32..3)
                .map(|octave| {
                    let finer = f64::from(1u32 << (2 * octave)) / background.size_px;
                    // Grey for the most part: all channels share the finer octaves.
                    let layer = if octave == 0 {
                        channel as u64
                    } else {
                        8 + u64::from(octave)
                    };
                    let value = blotches(key ^ hash(layer), column as f64 * finer, row as f64 * finer);
                    (2.0 * value - 1.0) * 0.7f64.powf(f64::from(octave))
                })
                .sum();
            (background.colour[channel] + background.contrast * sum / 2.19).clamp(0.0, 255.0) as f32
        })
    })
}
