//! A software rasteriser: colour, mask and depth of a mesh seen by a pinhole camera (Eq. 1).
//!
//! Each pixel is cut into `samples_per_axis`² samples. Colour and coverage are means over them; mask and depth are
//! the one at the pixel's centre, so they are exact there.

mod fragment;
mod light;
mod normals;
mod surface;

pub(super) use fragment::NEAR;
pub use light::{Light, LightFrame};
pub(super) use normals::corner_normals;
pub(super) use surface::{HOLE, UNPAINTED, is_hole};

use super::Mesh;
use crate::geometry::{Pinhole, Pose};
use crate::image::{DepthMap, Grid, Mask, RgbImage};
use fragment::Fragments;
use nalgebra::Vector3;

/// A camera, its pose and the size of its image.
#[derive(Clone, Copy, Debug)]
pub struct Viewpoint {
    pub camera: Pinhole,
    pub camera_from_object: Pose,
    pub width: usize,
    pub height: usize,
}

/// What a viewpoint shows. All rasters have its size.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// RGB in \[0, 255\], black where nothing covers; premultiplied by `coverage`.
    pub image: RgbImage,
    /// Share of the pixel's samples that are on the mesh.
    pub coverage: Grid<f32>,
    /// Whether the pixel's centre is on the mesh.
    pub mask: Mask,
    /// z in the camera frame at the pixel's centre; 0 off the mesh.
    pub depth: DepthMap,
}

/// A mesh made ready for many views.
pub struct Renderer<'a> {
    mesh: &'a Mesh,
    /// Unit normal at each corner of each triangle, object frame; the sign is arbitrary but one per triangle.
    normals: Vec<[Vector3<f64>; 3]>,
    samples_per_axis: usize,
}

impl<'a> Renderer<'a> {
    /// `samples_per_axis` is made odd by rounding up, so that one sample is the pixel's centre.
    pub fn new(mesh: &'a Mesh, samples_per_axis: usize) -> Self {
        Self {
            mesh,
            normals: corner_normals(mesh),
            samples_per_axis: samples_per_axis | 1,
        }
    }

    pub fn render(&self, view: &Viewpoint, light: &Light) -> Rendering {
        let samples = self.samples_per_axis;
        let fine = Viewpoint {
            camera: view.camera.scaled(samples as f64, samples as f64),
            width: view.width * samples,
            height: view.height * samples,
            ..*view
        };
        let fragments = Fragments::of(self.mesh, &fine);
        let light = light.in_object(&view.camera_from_object);
        let centre = view.camera_from_object.center();
        let shaded = Grid::from_fn(view.width, view.height, |column, row| {
            let (mut sum, mut hits) = ([0.0f32; 3], 0);
            for i in 0..samples * samples {
                let at = (column * samples + i % samples, row * samples + i / samples);
                if let Some(hit) = fragments.hit(at) {
                    let normals = &self.normals[hit.triangle];
                    let colour = surface::colour(self.mesh, normals, &hit, &light, &centre);
                    sum = std::array::from_fn(|c| sum[c] + colour[c]);
                    hits += 1;
                }
            }
            let share = 1.0 / (samples * samples) as f32;
            (sum.map(|value| value * share), hits as f32 * share)
        });
        let at_centre =
            |column: usize, row: usize| (column * samples + samples / 2, row * samples + samples / 2);
        Rendering {
            image: Grid::from_fn(view.width, view.height, |column, row| shaded[(column, row)].0),
            coverage: Grid::from_fn(view.width, view.height, |column, row| shaded[(column, row)].1),
            mask: Grid::from_fn(view.width, view.height, |column, row| {
                fragments.hit(at_centre(column, row)).is_some()
            }),
            depth: Grid::from_fn(view.width, view.height, |column, row| {
                fragments
                    .hit(at_centre(column, row))
                    .map_or(0.0, |hit| (1.0 / hit.inverse_depth) as f32)
            }),
        }
    }
}

#[cfg(test)]
mod tests;
