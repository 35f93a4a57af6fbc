//! A made-up video with full ground truth: cameras on an arc around a CAD model, and what off-the-shelf tools would
//! give for it, in a frame and scale of their own.
//!
//! The same scene gives the same bytes: all chance comes from its seed.

mod background;
mod benchmark;
mod config;
mod input;
mod lighting;
mod outside;

pub use benchmark::{Benchmark, renderer_digest};
pub use config::{Arc, Background, Camera, Jitter, Scene, SimulatedDepth, SimulatedInput, Via};
pub use lighting::Lighting;
pub(crate) use outside::outside_points;

use super::blender::Pictures;
use super::random::Random;
use super::render::{Light, Renderer, Rendering, Viewpoint};
use super::{CadError, Mesh, load_source, orbit};
use crate::geometry::{Pinhole, Pose, Rotation3, Vector3};
use crate::image::{DepthMap, Grid, RgbImage, blur};
use crate::sequence::{Frame, Sequence, SequenceContent, Truth};
use rayon::prelude::*;

/// Streams of chance, one per purpose, so that changing one option leaves what the others draw alone.
mod stream {
    pub(super) const CAMERA: u64 = 1;
    pub(super) const SENSOR: u64 = 2;
    pub(super) const POSE: u64 = 3;
    pub(super) const DEPTH: u64 = 4;
    pub(super) const HOLES: u64 = 5;
    pub(super) const BACKGROUND: u64 = 6;
}

/// Loads the model and makes the sequence, named `name`.
///
/// # Errors
/// An option out of its range, a model that cannot be read, or not exactly one model.
pub fn synthesise(scene: &Scene, name: &str) -> Result<Sequence, CadError> {
    scene.check()?;
    let models = load_source(&scene.model)?;
    let [model] = models.as_slice() else {
        return Err(CadError::Scene {
            field: "model",
            problem: format!("{} models; name one in include", models.len()),
        });
    };
    film(scene, &model.mesh, name)
}

/// The sequence of a mesh in the object frame; `scene.model` is not looked at.
///
/// # Errors
/// A background image that cannot be read, or a Blender that is asked for and does not run.
pub fn film(scene: &Scene, mesh: &Mesh, name: &str) -> Result<Sequence, CadError> {
    let shots: Vec<(Viewpoint, Light)> = (0..scene.arc.frames).map(|index| shot(scene, index)).collect();
    let backdrop = background::paint(scene)?;
    // A rendering lives no longer than its frame's turn: those of many frames would not fit into memory.
    let exposed: Vec<(Frame, DepthMap)> = match scene.via {
        Via::Own => {
            let renderer = Renderer::new(mesh, scene.samples_per_axis);
            let frame = |(index, (view, light)): (usize, &(Viewpoint, Light))| {
                expose(scene, index, view, renderer.render(view, light), &backdrop)
            };
            shots.par_iter().enumerate().map(frame).collect()
        }
        Via::Blender => {
            let pictures = Pictures::of(mesh, &shots, scene.samples_per_axis)?;
            let frame = |(index, (view, _)): (usize, &(Viewpoint, Light))| {
                Ok(expose(scene, index, view, pictures.rendering(index)?, &backdrop))
            };
            let frames = shots.par_iter().enumerate().map(frame);
            frames.collect::<Result<_, CadError>>()?
        }
    };
    let (frames, depth) = exposed.into_iter().unzip();
    Ok(Sequence::new(SequenceContent {
        name: name.to_owned(),
        frames,
        motion_deviation: None,
        focal_deviation: None,
        truth: Some(Truth {
            camera_from_object: shots.iter().map(|(view, _)| view.camera_from_object).collect(),
            depth,
            shape: outside_points(mesh, scene.truth_points),
        }),
    })?)
}

/// What is rendered for one frame.
fn shot(scene: &Scene, index: usize) -> (Viewpoint, Light) {
    let (arc, jitter) = (&scene.arc, &scene.arc.jitter);
    let mut random = Random::new(scene.seed, stream::CAMERA, index as u64);
    let share = index as f64 / (arc.frames.max(2) - 1) as f64;
    let [start, end] = arc.azimuth_deg;
    let azimuth = start + share * (end - start) + jitter.angle_deg * random.normal();
    let elevation = arc.elevation_deg + jitter.angle_deg * random.normal();
    let distance = arc.distance * (1.0 + jitter.distance * random.normal()).max(0.5);
    let looking_at_centre = orbit(azimuth, elevation, distance);
    let roll = Pose {
        rotation: Rotation3::from_axis_angle(
            &Vector3::z_axis(),
            (jitter.angle_deg * random.normal()).to_radians(),
        ),
        translation: Vector3::new(random.normal(), random.normal(), 0.0) * jitter.aim,
    };
    let zoom = 1.0 + jitter.zoom * random.normal();
    let view = Viewpoint {
        camera: Pinhole {
            fx: scene.camera.focal_px * zoom,
            fy: scene.camera.focal_px * zoom,
            cx: scene.camera.principal_px[0],
            cy: scene.camera.principal_px[1],
        },
        camera_from_object: roll.after(&looking_at_centre),
        width: scene.camera.width_px,
        height: scene.camera.height_px,
    };
    (view, scene.light.at(share))
}

/// The frame that a camera and off-the-shelf tools make of a rendering, and its true depth.
fn expose(
    scene: &Scene,
    index: usize,
    view: &Viewpoint,
    rendering: Rendering,
    backdrop: &RgbImage,
) -> (Frame, DepthMap) {
    let image = sensor(scene, index, &rendering, backdrop);
    let frame = Frame {
        name: format!("{index:03}"),
        depth: Some(input::depth(scene, index, &image, &rendering)),
        depth_deviation: None,
        image: image.into(),
        mask: rendering.mask,
        camera: view.camera,
        timestamp_s: Some(index as f64 / scene.arc.frames_per_second),
        camera_from_input: Some(input::pose(scene, index, &view.camera_from_object)),
    };
    (frame, rendering.depth)
}

/// The rendering over the backdrop, blurred, with noise, as whole grey levels.
fn sensor(scene: &Scene, index: usize, rendering: &Rendering, backdrop: &RgbImage) -> RgbImage {
    let mut random = Random::new(scene.seed, stream::SENSOR, index as u64);
    let (width, height) = rendering.image.size();
    let sharp = Grid::from_fn(width, height, |column, row| {
        let at = (column, row);
        let behind = 1.0 - rendering.coverage[at];
        std::array::from_fn(|c| rendering.image[at][c] + behind * backdrop[at][c])
    });
    let clean = match scene.blur_px {
        0.0 => sharp,
        deviation_px => blur(&sharp, deviation_px),
    };
    Grid::from_fn(width, height, |column, row| {
        clean[(column, row)].map(|value| {
            let noise = scene.image_noise * random.normal();
            (value + noise as f32).round().clamp(0.0, 255.0)
        })
    })
}

#[cfg(test)]
mod tests;
