//! The z-buffer: which triangle each sample sees, and where on it.

use super::super::{Mesh, Triangle};
use super::{Viewpoint, surface};
use crate::image::Grid;
use nalgebra::{Vector2, Vector3};

/// Nearer than this, in object diagonals, nothing is drawn.
pub(in crate::cad) const NEAR: f64 = 1e-3;

/// What a sample sees.
#[derive(Clone, Copy)]
pub(super) struct Hit {
    pub(super) triangle: usize,
    /// 1 / z of the camera frame.
    pub(super) inverse_depth: f64,
    /// Weights of the triangle's corners, which sum to 1.
    pub(super) weights: Vector3<f64>,
}

/// The nearest hit of every sample of a view.
pub(super) struct Fragments {
    hits: Grid<Option<Hit>>,
}

/// A corner after clipping: its place in the camera frame and in its triangle.
#[derive(Clone, Copy)]
struct Corner {
    in_camera: Vector3<f64>,
    weights: Vector3<f64>,
}

impl Fragments {
    pub(super) fn of(mesh: &Mesh, view: &Viewpoint) -> Self {
        let mut fragments = Self {
            hits: Grid::filled(view.width, view.height, None),
        };
        let in_camera: Vec<Vector3<f64>> = mesh
            .vertices
            .iter()
            .map(|vertex| view.camera_from_object.transform(vertex))
            .collect();
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let corner = |i: usize| Corner {
                in_camera: in_camera[triangle.vertices[i] as usize],
                weights: Vector3::ith(i, 1.0),
            };
            let polygon = clip(&[corner(0), corner(1), corner(2)]);
            for i in 2..polygon.len() {
                fragments.fill(
                    mesh,
                    view,
                    index,
                    triangle,
                    [polygon[0], polygon[i - 1], polygon[i]],
                );
            }
        }
        fragments
    }

    pub(super) fn hit(&self, (column, row): (usize, usize)) -> Option<Hit> {
        self.hits.get(column, row).copied().flatten()
    }

    fn fill(
        &mut self,
        mesh: &Mesh,
        view: &Viewpoint,
        index: usize,
        triangle: &Triangle,
        corners: [Corner; 3],
    ) {
        let inverse = corners.map(|corner| 1.0 / corner.in_camera.z);
        let pixels: [Vector2<f64>; 3] = std::array::from_fn(|i| {
            let at = corners[i].in_camera * inverse[i];
            let camera = &view.camera;
            Vector2::new(camera.fx * at.x + camera.cx, camera.fy * at.y + camera.cy)
        });
        let area = cross(&pixels[0], &pixels[1], &pixels[2]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let range = |axis: usize, size: usize| {
            let low = pixels.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
            let high = pixels.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
            // The centres between low and high; the casts saturate at 0 and at the image's end.
            (low - 0.5).ceil().max(0.0) as usize..(high + 0.5).floor().clamp(0.0, size as f64) as usize
        };
        for row in range(1, view.height) {
            for column in range(0, view.width) {
                let centre = Vector2::new(column as f64 + 0.5, row as f64 + 0.5);
                let on_screen = Vector3::new(
                    cross(&centre, &pixels[1], &pixels[2]),
                    cross(&pixels[0], &centre, &pixels[2]),
                    cross(&pixels[0], &pixels[1], &centre),
                ) / area;
                if on_screen.min() < 0.0 {
                    continue;
                }
                // 1 / z is linear on the screen; so is weight / z.
                let scaled = on_screen.component_mul(&Vector3::from(inverse));
                let inverse_depth = scaled.sum();
                let at = (column, row);
                if self.hits[at].is_some_and(|hit| hit.inverse_depth >= inverse_depth) {
                    continue;
                }
                let weights = (0..3)
                    .map(|i| corners[i].weights * (scaled[i] / inverse_depth))
                    .sum::<Vector3<f64>>();
                if surface::is_hole(mesh, triangle, &weights) {
                    continue;
                }
                self.hits[at] = Some(Hit {
                    triangle: index,
                    inverse_depth,
                    weights,
                });
            }
        }
    }
}

/// Twice the signed area of a, b, c.
fn cross(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

/// The part of a triangle in front of the near plane (Sutherland–Hodgman): no corner, three or four.
fn clip(triangle: &[Corner; 3]) -> Vec<Corner> {
    let mut kept = Vec::with_capacity(4);
    for i in 0..3 {
        let (from, to) = (triangle[i], triangle[(i + 1) % 3]);
        let (from_inside, to_inside) = (from.in_camera.z >= NEAR, to.in_camera.z >= NEAR);
        if from_inside {
            kept.push(from);
        }
        if from_inside != to_inside {
            let share = (NEAR - from.in_camera.z) / (to.in_camera.z - from.in_camera.z);
            kept.push(Corner {
                in_camera: from.in_camera.lerp(&to.in_camera, share),
                weights: from.weights.lerp(&to.weights, share),
            });
        }
    }
    kept
}
