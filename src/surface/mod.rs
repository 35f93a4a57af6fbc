//! Triangles as a camera sees them: what covers a pixel, and what hides a point. Visibility, overlays, densities and `eval` all draw with it.

mod facets;
mod nearest;

pub(crate) use facets::{Facets, median};
pub(crate) use nearest::{Neighbours, spacing};

use crate::geometry::{Pinhole, Pose, Vector3};
use std::borrow::Cow;
use std::ops::Range;

/// A triangle mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Object frame.
    pub vertices: Vec<Vector3<f64>>,
    /// Indices of the vertices, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

/// A closed mesh, with the planes of its faces.
#[derive(Clone, Debug)]
pub struct ClosedMesh {
    mesh: Mesh,
    /// Per face its outward normal, and how far along it the face lies.
    planes: Vec<(Vector3<f64>, f64)>,
}

impl ClosedMesh {
    pub fn new(mesh: Mesh) -> Self {
        let plane = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            let normal = (b - a).cross(&(c - a));
            (normal, normal.dot(&a))
        };
        Self {
            planes: mesh.faces.iter().map(plane).collect(),
            mesh,
        }
    }
}

/// A point in a camera: where in the image, and how far along the optical axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projected {
    pub u: f64,
    pub v: f64,
    pub z: f64,
}

impl Projected {
    /// `None` where the point is not in front of the camera.
    pub fn new(in_camera: &Vector3<f64>, camera: &Pinhole) -> Option<Self> {
        camera.project(in_camera).map(|pixel| Self {
            u: pixel.x,
            v: pixel.y,
            z: in_camera.z,
        })
    }
}

/// The pixel (column, row) that holds the image point (`u`, `v`); `None` outside the image.
pub(crate) fn pixel_of(u: f64, v: f64, (width, height): (usize, usize)) -> Option<(usize, usize)> {
    (u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64).then_some((u as usize, v as usize))
}

/// What of a triangle covers a place in the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Covering {
    pub z: f64,
    /// Of its corners, the one that is nearest in the image.
    pub corner: u32,
}

/// Triangles in a camera; those that touch a vertex behind it are left out.
pub(crate) struct InCamera<'a> {
    vertices: Vec<Option<Projected>>,
    faces: Cow<'a, [[u32; 3]]>,
}

impl<'a> InCamera<'a> {
    pub fn new(
        vertices: &[Vector3<f64>],
        faces: &'a [[u32; 3]],
        camera: &Pinhole,
        camera_from_object: &Pose,
    ) -> Self {
        let projected = |vertex| Projected::new(&camera_from_object.transform(vertex), camera);
        Self {
            vertices: vertices.iter().map(projected).collect(),
            faces: faces.into(),
        }
    }

    /// Of a closed mesh, only what shows the camera its front: it hides as much as the whole.
    pub fn of_closed(mesh: &ClosedMesh, camera: &Pinhole, camera_from_object: &Pose) -> Self {
        let eye = camera_from_object.center();
        let planes = mesh.planes.iter().zip(&mesh.mesh.faces);
        let front = planes.filter(|((normal, offset), _)| normal.dot(&eye) > *offset);
        Self {
            faces: front.map(|(_, face)| *face).collect(),
            ..Self::new(&mesh.mesh.vertices, &[], camera, camera_from_object)
        }
    }

    pub fn vertices(&self) -> &[Option<Projected>] {
        &self.vertices
    }

    fn triangles(&self) -> impl Iterator<Item = (Triangle, &[u32; 3])> {
        self.faces
            .iter()
            .filter_map(|face| match face.map(|v| self.vertices[v as usize]) {
                [Some(a), Some(b), Some(c)] => Some((Triangle::new([a, b, c])?, face)),
                _ => None,
            })
    }

    /// Calls `covered` with every pixel of a `size` = (width, height) image whose centre lies in a triangle, triangle by triangle.
    pub fn draw(&self, size: (usize, usize), mut covered: impl FnMut((usize, usize), Covering)) {
        for (triangle, face) in self.triangles() {
            let [columns, rows] = triangle.sides.map(|[low, high]| (low - 0.5, high + 0.5));
            let columns = pixels(columns, size.0);
            if columns.is_empty() {
                continue;
            }
            for row in pixels(rows, size.1) {
                for column in columns.clone() {
                    if let Some(weights) = triangle.weights(column as f64 + 0.5, row as f64 + 0.5) {
                        let nearest =
                            (1..3).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
                        covered(
                            (column, row),
                            Covering {
                                z: triangle.z(weights),
                                corner: face[nearest],
                            },
                        );
                    }
                }
            }
        }
    }

    /// Per point: whether a triangle covers it, nearer to the camera by more than `tolerance` (object units). Points outside a `size` =
    /// (width, height) image are not looked at.
    pub fn hidden(&self, points: &[Option<Projected>], size: (usize, usize), tolerance: f64) -> Vec<bool> {
        let binned = Binned::new(points, size);
        let mut hidden = vec![false; points.len()];
        for (triangle, _) in self.triangles() {
            let nearest = triangle
                .corners
                .iter()
                .fold(f64::INFINITY, |z, corner| z.min(corner.z));
            let [columns, rows] = triangle.sides.map(|[low, high]| (low - 1.0, high + 1.0));
            let columns = pixels(columns, size.0);
            if columns.is_empty() {
                continue;
            }
            for row in pixels(rows, size.1) {
                for &(point, index) in binned.within(columns.clone(), row) {
                    let hidden = &mut hidden[index as usize];
                    if point.z > nearest + tolerance
                        && !*hidden
                        && let Some(weights) = triangle.weights(point.u, point.v)
                    {
                        *hidden = point.z > triangle.z(weights) + tolerance;
                    }
                }
            }
        }
        hidden
    }
}

struct Triangle {
    corners: [Projected; 3],
    /// Twice the signed area.
    area: f64,
    /// The least and the greatest coordinate across and down.
    sides: [[f64; 2]; 2],
}

/// A triangle whose area is a smaller share of its box's squared diagonal is seen edge-on, but for rounding: nothing is inside it.
const MIN_AREA: f64 = 1e-9;

impl Triangle {
    fn new(corners: [Projected; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let area = cross(a, b, c.u, c.v);
        let side = |of: [f64; 3]| [of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2])];
        let sides = [side(corners.map(|p| p.u)), side(corners.map(|p| p.v))];
        let reach: f64 = sides.iter().map(|[low, high]| (high - low).powi(2)).sum();
        (area.abs() > MIN_AREA * reach).then_some(Self { corners, area, sides })
    }

    /// How near an image point is to each corner, 1 in all; `None` outside the triangle.
    fn weights(&self, u: f64, v: f64) -> Option<[f64; 3]> {
        let [a, b, c] = self.corners;
        let parts = [cross(b, c, u, v), cross(c, a, u, v), cross(a, b, u, v)];
        parts
            .iter()
            .all(|part| part * self.area >= 0.0)
            .then(|| parts.map(|part| part / self.area))
    }

    /// 1 / z is linear across a triangle.
    fn z(&self, weights: [f64; 3]) -> f64 {
        let [a, b, c] = self.corners;
        1.0 / (weights[0] / a.z + weights[1] / b.z + weights[2] / c.z)
    }
}

/// Twice the signed area of (a, b, (u, v)).
fn cross(a: Projected, b: Projected, u: f64, v: f64) -> f64 {
    (b.u - a.u) * (v - a.v) - (b.v - a.v) * (u - a.u)
}

/// The pixels along one axis from the first that begins at or after `low` to the last that ends at or before `high`.
fn pixels((low, high): (f64, f64), size: usize) -> Range<usize> {
    let clamp = |pixel: f64| pixel.clamp(0.0, size as f64);
    let least = clamp(low);
    // `least.ceil()` without the function call that it is on processors of no particular kind: there are millions of triangles.
    let low = least as usize + usize::from(least > (least as usize) as f64);
    low..(clamp(high) as usize).max(low)
}

/// Points by the pixel that holds them, row after row.
struct Binned {
    width: usize,
    /// Where each pixel's points begin, and the last one's end.
    starts: Vec<u32>,
    /// With their indices.
    points: Vec<(Projected, u32)>,
}

impl Binned {
    fn new(points: &[Option<Projected>], size: (usize, usize)) -> Self {
        let cell = |p: Projected| pixel_of(p.u, p.v, size).map(|(column, row)| row * size.0 + column);
        let mut starts = vec![0; size.0 * size.1 + 1];
        let mut placed = Vec::with_capacity(points.len());
        for (index, point) in (0u32..).zip(points) {
            if let Some((point, cell)) = point.and_then(|p| Some((p, cell(p)?))) {
                starts[cell + 1] += 1;
                placed.push((cell, (point, index)));
            }
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut sorted: Vec<(Projected, u32)> = placed.iter().map(|(_, point)| *point).collect();
        for (cell, point) in placed {
            sorted[next[cell] as usize] = point;
            next[cell] += 1;
        }
        Self {
            width: size.0,
            starts,
            points: sorted,
        }
    }

    fn within(&self, columns: Range<usize>, row: usize) -> &[(Projected, u32)] {
        let at = |column: usize| self.starts[row * self.width + column] as usize;
        &self.points[at(columns.start)..at(columns.end)]
    }
}
