//! Many models on one picture, to check them by eye: three-quarter from the front, from its left, from the rear.

use super::render::{Light, Renderer, Viewpoint};
use super::{Mesh, NamedModel, orbit};
use crate::geometry::Pinhole;
use crate::image::{Grid, RgbImage};
use rayon::prelude::*;

/// (azimuth, elevation) in degrees of the views of one row, see [`orbit`].
const VIEWS: [(f64, f64); 3] = [(35.0, 20.0), (-90.0, 5.0), (-145.0, 25.0)];

/// `columns` models a row, each as a strip of three square pictures of `size` pixels.
pub fn contact_sheet(models: &[NamedModel], columns: usize, size: usize) -> RgbImage {
    let columns = columns.max(1);
    let strips: Vec<RgbImage> = models.par_iter().map(|model| strip(&model.mesh, size)).collect();
    let rows = models.len().div_ceil(columns);
    Grid::from_fn(columns * VIEWS.len() * size, rows * size, |x, y| {
        let (column, row) = (x / (VIEWS.len() * size), y / size);
        strips
            .get(row * columns + column)
            .map_or([0.0; 3], |strip| strip[(x % (VIEWS.len() * size), y % size)])
    })
}

fn strip(mesh: &Mesh, size: usize) -> RgbImage {
    let renderer = Renderer::new(mesh, 3);
    let side = size as f64;
    let pictures = VIEWS.map(|(azimuth_deg, elevation_deg)| {
        let view = Viewpoint {
            camera: Pinhole {
                fx: 2.4 * side,
                fy: 2.4 * side,
                cx: side / 2.0,
                cy: side / 2.0,
            },
            camera_from_object: orbit(azimuth_deg, elevation_deg, 2.2),
            width: size,
            height: size,
        };
        renderer.render(&view, &Light::default())
    });
    Grid::from_fn(VIEWS.len() * size, size, |x, y| {
        let (picture, at) = (&pictures[x / size], (x % size, y));
        picture.image[at].map(|value| value + 90.0 * (1.0 - picture.coverage[at]))
    })
}
