//! What the solved shape looks like in a camera: points with the small facets around them, and a z-buffer.

use super::Neighbours;
use super::facets;
use crate::geometry::{Pinhole, Pose, Similarity, Vector3, tangent_plane};
use crate::image::{DepthMap, Grid, Mask};
use crate::init::Estimate;
use crate::prior::{LearnedPrior, ShapePrior, subdivided};
use crate::solver::Solution;
use std::sync::Arc;

/// Points on a surface, each with a footprint: the facets that join it to its neighbours. Object frame and units.
///
/// Facets span the surface between the points and end with them, so that a silhouette is not inflated the way
/// discs around the points inflate it at sharp edges.
#[derive(Clone, Debug)]
pub struct Surface {
    points: Vec<Vector3<f64>>,
    normals: Vec<Vector3<f64>>,
    facets: Vec<[u32; 3]>,
    spacing: f64,
    /// By point, object units; empty where they are unknown.
    deviations: Vec<f64>,
    /// Where the facets are those of one closed mesh: that mesh, before it was cut finer.
    mesh: Option<Arc<UnwrappedMesh>>,
}

/// A closed mesh with texture coordinates, object frame.
#[derive(Clone, Debug)]
pub struct UnwrappedMesh {
    pub(super) vertices: Vec<Vector3<f64>>,
    /// Unit normals, one a vertex.
    pub(super) normals: Vec<Vector3<f64>>,
    /// Indices of the vertices, counter-clockwise seen from outside.
    pub(super) faces: Vec<[u32; 3]>,
    /// Per corner of the faces: in \[0, 1\], u to the right, v up; 1 − u is the mirror image's.
    pub(super) texture_coordinates: Vec<[[f32; 2]; 3]>,
}

impl UnwrappedMesh {
    /// A face of a vertex that there is not, or without texture coordinates, is left out.
    pub fn new(
        vertices: Vec<Vector3<f64>>,
        faces: Vec<[u32; 3]>,
        texture_coordinates: Vec<[[f32; 2]; 3]>,
    ) -> Self {
        let known = |face: &[u32; 3]| face.iter().all(|&v| (v as usize) < vertices.len());
        let (faces, texture_coordinates): (Vec<_>, Vec<_>) = faces
            .into_iter()
            .zip(texture_coordinates)
            .filter(|(face, _)| known(face))
            .unzip();
        Self {
            normals: normals(&vertices, &faces),
            vertices,
            faces,
            texture_coordinates,
        }
    }

    /// The mean of a face's corners' vectors by their weights.
    pub(super) fn at(&self, face: u32, weights: [f32; 3], of: &[Vector3<f64>]) -> Vector3<f64> {
        let corners = self.faces[face as usize].iter().zip(weights);
        corners
            .map(|(&vertex, weight)| of[vertex as usize] * f64::from(weight))
            .sum()
    }
}

/// Values of a mesh's vertices, and after them those of the middles of its edges, as [`subdivided`] orders them.
fn at_middles(values: &[f64], faces: &[[u32; 3]]) -> Vec<f64> {
    let along_x: Vec<_> = values.iter().map(|&x| Vector3::new(x, 0.0, 0.0)).collect();
    subdivided(&along_x, faces).0.iter().map(|v| v.x).collect()
}

/// Unit normals of the vertices, weighted by area.
fn normals(vertices: &[Vector3<f64>], faces: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    let mut sums = vec![Vector3::zeros(); vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| vertices[v as usize]);
        let twice_area = (b - a).cross(&(c - a));
        face.iter().for_each(|&v| sums[v as usize] += twice_area);
    }
    sums.into_iter()
        .map(|normal| normal.try_normalize(1e-18).unwrap_or(Vector3::y()))
        .collect()
}

/// The z-buffer of a [`Surface`] in one camera.
#[derive(Clone, Debug)]
pub struct ZBuffer {
    /// z of the nearest facet where the ray through the pixel's centre meets it, object units; 0 = none.
    pub depth: DepthMap,
    /// The index of the point whose footprint is nearest, one per pixel; `None` where there is none.
    pub index: Grid<Option<u32>>,
    /// The points that the near side does not hide, ascending.
    pub visible: Vec<u32>,
}

impl ZBuffer {
    /// The silhouette: true where a footprint covers the pixel.
    pub fn mask(&self) -> Mask {
        self.depth.known()
    }
}

impl Surface {
    /// Estimates facets, normals (least-squares planes, turned away from the centroid) and spacing from the points
    /// alone (N × 3, object frame).
    pub fn from_points(points: Vec<Vector3<f64>>) -> Self {
        let tree = Neighbours::new(&points);
        let rings: Vec<_> = points
            .iter()
            .map(|point| tree.nearest(point, facets::RING + 1))
            .collect();
        let centroid = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let normals: Vec<_> = points
            .iter()
            .zip(&rings)
            .map(|(point, ring)| {
                let around: Vec<_> = ring.iter().map(|&(i, _)| points[i]).collect();
                let (normal, _) = tangent_plane(&around);
                if normal.dot(&(point - centroid)) < 0.0 {
                    -normal
                } else {
                    normal
                }
            })
            .collect();
        Self {
            facets: facets::around_points(&points, &normals, &rings),
            spacing: median(
                rings
                    .iter()
                    .filter_map(|ring| ring.get(1))
                    .map(|&(_, distance)| distance),
            ),
            points,
            normals,
            deviations: Vec::new(),
            mesh: None,
        }
    }

    /// `mesh` with each of its faces cut into four for the sake of colours; the vertices of these are the points, the mesh's own first.
    pub fn from_mesh(mesh: UnwrappedMesh) -> Self {
        let (points, facets) = subdivided(&mesh.vertices, &mesh.faces);
        let lengths = facets.iter().flat_map(|&[a, b, c]| {
            [[a, b], [b, c], [c, a]].map(|[a, b]| (points[a as usize] - points[b as usize]).norm())
        });
        Self {
            normals: normals(&points, &facets),
            spacing: median(lengths),
            points,
            facets,
            deviations: Vec::new(),
            mesh: Some(Arc::new(mesh)),
        }
    }

    /// The shape of an estimate in the prior's frame, moved to the object frame, and the estimate moved along.
    pub fn of_estimate(prior: &LearnedPrior, estimate: &Estimate) -> (Self, Estimate) {
        let canonical = prior.canonical_from_shape(&estimate.style, &[]);
        let moved = match &canonical {
            Some(canonical) => estimate.in_frame(canonical),
            None => estimate.clone(),
        };
        (
            Self::of_shape(prior, &estimate.style, &[], canonical.as_ref()),
            moved,
        )
    }

    /// The shape that was found, in the object frame.
    pub fn of(prior: &LearnedPrior, solution: &Solution) -> Self {
        let canonical = solution.canonical_from_shape.as_ref();
        let (style, form) = (&solution.estimate.style, &solution.free_form);
        let found = Self::of_shape(prior, style, form, canonical);
        let deviations = match (prior.surface(), &solution.deviations) {
            (Some(prior), Some(known)) => prior
                .vertex_deviations(style, form, &known.shape, &known.frame)
                .map(|of| at_middles(&of, &prior.mesh().faces())),
            _ => None,
        };
        Self {
            deviations: deviations.unwrap_or_default(),
            ..found
        }
    }

    fn of_shape(
        prior: &LearnedPrior,
        style: &[f64],
        free_form: &[f64],
        canonical_from_shape: Option<&Similarity>,
    ) -> Self {
        let moved = |points: Vec<Vector3<f64>>| -> Vec<Vector3<f64>> {
            match canonical_from_shape {
                Some(canonical) => points.iter().map(|point| canonical.transform(point)).collect(),
                None => points,
            }
        };
        match prior.surface() {
            Some(surface) => Self::from_mesh(UnwrappedMesh::new(
                moved(surface.vertices(style, free_form)),
                surface.mesh().faces(),
                surface.mesh().texture_coordinates(),
            )),
            None => Self::from_points(moved(prior.shape(style))),
        }
    }

    /// The mesh, where the shape is one.
    pub fn mesh(&self) -> Option<&UnwrappedMesh> {
        self.mesh.as_deref()
    }

    /// Triangles over the points; of a mesh, they are all of it.
    pub fn facets(&self) -> &[[u32; 3]] {
        &self.facets
    }

    /// The points, N × 3, object frame.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Unit normals, one per point, mostly outward.
    pub fn normals(&self) -> &[Vector3<f64>] {
        &self.normals
    }

    /// Standard deviations of the points, root mean square over all directions, object units; empty where they are unknown.
    pub fn deviations(&self) -> &[f64] {
        &self.deviations
    }

    /// The median distance from a point to its nearest neighbour, object units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Draws the shape into a `size` = (width, height) image. Every point in front of the camera covers at least
    /// the pixel that holds it; points behind the camera are skipped, with the facets that touch them.
    pub fn render(&self, camera: &Pinhole, camera_from_object: &Pose, size: (usize, usize)) -> ZBuffer {
        let mut canvas = Canvas {
            depth: Grid::filled(size.0, size.1, 0.0),
            index: Grid::filled(size.0, size.1, None),
        };
        let projected: Vec<Option<Projected>> = self
            .points
            .iter()
            .map(|point| {
                let in_camera = camera_from_object.transform(point);
                let pixel = camera.project(&in_camera)?;
                Some(Projected {
                    u: pixel.x,
                    v: pixel.y,
                    z: in_camera.z,
                })
            })
            .collect();
        for facet in &self.facets {
            if let [Some(a), Some(b), Some(c)] = facet.map(|i| projected[i as usize]) {
                canvas.draw_facet([a, b, c], facet);
            }
        }
        for (i, point) in projected.iter().enumerate() {
            if let Some((pixel, z)) = point.and_then(|p| Some((canvas.depth.pixel_at(p.u, p.v)?, p.z)))
                && canvas.depth[pixel] == 0.0
            {
                canvas.keep_nearest(pixel, z, i as u32);
            }
        }
        // A facet may stand out before its points by its sag, and the depth under a pixel varies.
        let tolerance = |z: f64| self.spacing + z / camera.fx.min(camera.fy);
        let visible = (0u32..)
            .zip(&projected)
            .filter_map(|(i, point)| {
                let p = (*point)?;
                let front = canvas.depth[canvas.depth.pixel_at(p.u, p.v)?];
                (p.z <= f64::from(front) + tolerance(p.z)).then_some(i)
            })
            .collect();
        ZBuffer {
            depth: canvas.depth,
            index: canvas.index,
            visible,
        }
    }
}

#[derive(Clone, Copy)]
struct Projected {
    u: f64,
    v: f64,
    z: f64,
}

struct Canvas {
    depth: DepthMap,
    index: Grid<Option<u32>>,
}

impl Canvas {
    /// Fills the pixels whose centres lie in the triangle; 1 / z is linear across it.
    fn draw_facet(&mut self, corners: [Projected; 3], points: &[u32; 3]) {
        let [a, b, c] = corners;
        let area = cross(a, b, c.u, c.v);
        let columns = pixels(corners.map(|p| p.u), self.depth.width());
        if columns.is_empty() {
            return;
        }
        for row in pixels(corners.map(|p| p.v), self.depth.height()) {
            for column in columns.clone() {
                let (u, v) = (column as f64 + 0.5, row as f64 + 0.5);
                let parts = [cross(b, c, u, v), cross(c, a, u, v), cross(a, b, u, v)];
                // Nothing is inside a facet that is seen edge-on.
                if parts.iter().all(|part| part * area >= 0.0) && area != 0.0 {
                    let weights = parts.map(|part| part / area);
                    let inverse_depth = weights[0] / a.z + weights[1] / b.z + weights[2] / c.z;
                    let nearest_corner =
                        (0..3).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
                    self.keep_nearest((column, row), 1.0 / inverse_depth, points[nearest_corner]);
                }
            }
        }
    }

    fn keep_nearest(&mut self, pixel: (usize, usize), z: f64, point: u32) {
        let z = z as f32;
        if self.depth[pixel] == 0.0 || z < self.depth[pixel] {
            self.depth[pixel] = z;
            self.index[pixel] = Some(point);
        }
    }
}

/// Twice the signed area of (a, b, (u, v)).
fn cross(a: Projected, b: Projected, u: f64, v: f64) -> f64 {
    (b.u - a.u) * (v - a.v) - (b.v - a.v) * (u - a.u)
}

/// The pixels along one axis whose centres lie between the least and the greatest coordinate.
fn pixels(coordinates: [f64; 3], size: usize) -> std::ops::Range<usize> {
    let [a, b, c] = coordinates;
    let clamp = |pixel: f64| pixel.clamp(0.0, size as f64);
    let least = clamp(a.min(b).min(c) - 0.5);
    // `least.ceil()` without the function call that it is on processors of no particular kind: there are millions of facets.
    let low = least as usize + usize::from(least > (least as usize) as f64);
    low..(clamp(a.max(b).max(c) + 0.5) as usize).max(low)
}

pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<_> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
