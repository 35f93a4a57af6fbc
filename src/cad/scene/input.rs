//! What off-the-shelf tools would give: noisy poses and semi-dense depth in a frame and scale of their own.

use super::super::random::{Random, blotches, hash};
use super::{Rendering, Scene, stream};
use crate::geometry::{Pose, Rotation3, Vector3};
use crate::image::{DepthMap, Grid, RgbImage};

/// Blotchy holes are about this large.
const HOLE_PX: f64 = 12.0;

/// `camera_from_input` of a frame: R' = R Rᵢᵀ, t' = scale · t − R' tᵢ, with noise on R and t.
pub(super) fn pose(scene: &Scene, index: usize, camera_from_object: &Pose) -> Pose {
    let input = &scene.input;
    let mut random = Random::new(scene.seed, stream::POSE, index as u64);
    let mut noise = |deviation: f64| Vector3::from_fn(|_, _| deviation * random.normal());
    // About the object's centre, as errors of a reconstruction of the object are: a turn about the camera instead
    // would move the object across the picture.
    let turn = Rotation3::from_scaled_axis(noise(input.rotation_noise_deg.to_radians()));
    let shift = noise(input.translation_noise * camera_from_object.translation.norm());
    let input_from_object =
        Rotation3::from_scaled_axis(Vector3::from(input.rotation_deg.map(f64::to_radians)));
    let rotation = camera_from_object.rotation * turn * input_from_object.inverse();
    Pose {
        rotation,
        translation: input.scale * (camera_from_object.translation + shift)
            - rotation * Vector3::from(input.translation),
    }
}

/// z in input units where the image has texture, 0 elsewhere.
pub(super) fn depth(scene: &Scene, index: usize, image: &RgbImage, rendering: &Rendering) -> DepthMap {
    let options = &scene.depth;
    let mut random = Random::new(scene.seed, stream::DEPTH, index as u64);
    let key = hash(hash(scene.seed ^ stream::HOLES) ^ index as u64);
    let (width, height) = image.size();
    Grid::from_fn(width, height, |column, row| {
        // Drawn for every pixel, so that one pixel's fate does not move the others'.
        let (chance, error, error_size) = (random.uniform(), random.normal(), random.uniform());
        let hole = blotches(key, column as f64 / HOLE_PX, row as f64 / HOLE_PX) < options.holes;
        if hole || gradient(image, column, row) < options.min_gradient {
            return 0.0;
        }
        let true_z = f64::from(rendering.depth[(column, row)]);
        let z = if true_z > 0.0 {
            if chance < options.outliers {
                true_z * (0.7 + 0.6 * error_size)
            } else {
                true_z * (1.0 + options.noise * error)
            }
        } else if chance < options.background {
            scene.arc.distance * (0.7 + 0.8 * error_size)
        } else {
            return 0.0;
        };
        (scene.input.scale * z) as f32
    })
}

/// Norm of the central difference of the mean of the channels, grey levels per pixel; 0 on the border.
fn gradient(image: &RgbImage, column: usize, row: usize) -> f64 {
    let grey = |column: usize, row: usize| {
        let pixel = image.get(column, row)?;
        Some(f64::from(pixel.iter().sum::<f32>()) / 3.0)
    };
    let difference = || -> Option<f64> {
        let x = grey(column + 1, row)? - grey(column.checked_sub(1)?, row)?;
        let y = grey(column, row + 1)? - grey(column, row.checked_sub(1)?)?;
        Some(x.hypot(y) / 2.0)
    };
    difference().unwrap_or(0.0)
}
