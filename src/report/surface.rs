//! What the solved shape looks like in a camera: points with the small facets around them, and a z-buffer.

use crate::geometry::{Pinhole, Pose, Similarity, Vector3};
use crate::image::{DepthMap, Grid, Mask};
use crate::init::Estimate;
use crate::prior::{LearnedPrior, ShapePrior, subdivided};
use crate::solver::Solution;
use crate::surface::{Facets, InCamera, median, pixel_of};
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
        let Facets {
            faces,
            normals,
            spacing,
        } = Facets::around(&points);
        Self {
            points,
            normals,
            facets: faces,
            spacing,
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

    /// The points that the near side does not hide, ascending.
    pub(super) fn visible(
        &self,
        camera: &Pinhole,
        camera_from_object: &Pose,
        size: (usize, usize),
    ) -> Vec<u32> {
        let drawn = InCamera::new(&self.points, &self.facets, camera, camera_from_object);
        self.unhidden(&drawn, size)
    }

    fn unhidden(&self, drawn: &InCamera, size: (usize, usize)) -> Vec<u32> {
        // A facet may stand out before its points by its sag.
        let hidden = drawn.hidden(drawn.vertices(), size, self.spacing);
        (0u32..)
            .zip(drawn.vertices().iter().zip(hidden))
            .filter(|(_, (place, hidden))| {
                !hidden && place.is_some_and(|p| pixel_of(p.u, p.v, size).is_some())
            })
            .map(|(i, _)| i)
            .collect()
    }

    /// Draws the shape into a `size` = (width, height) image. Every point in front of the camera covers at least
    /// the pixel that holds it; points behind the camera are skipped, with the facets that touch them.
    pub fn render(&self, camera: &Pinhole, camera_from_object: &Pose, size: (usize, usize)) -> ZBuffer {
        let drawn = InCamera::new(&self.points, &self.facets, camera, camera_from_object);
        let mut depth: DepthMap = Grid::filled(size.0, size.1, 0.0);
        let mut index = Grid::filled(size.0, size.1, None);
        let mut keep_nearest = |depth: &mut DepthMap, pixel: (usize, usize), z: f64, point: u32| {
            let z = z as f32;
            if depth[pixel] == 0.0 || z < depth[pixel] {
                depth[pixel] = z;
                index[pixel] = Some(point);
            }
        };
        drawn.draw(size, |pixel, covering| {
            keep_nearest(&mut depth, pixel, covering.z, covering.corner);
        });
        let covered = depth.known();
        let in_image: Vec<_> = drawn
            .vertices()
            .iter()
            .map(|vertex| vertex.and_then(|p| Some((p, pixel_of(p.u, p.v, size)?))))
            .collect();
        for (point, place) in (0u32..).zip(&in_image) {
            if let &Some((p, pixel)) = place
                && !covered[pixel]
            {
                keep_nearest(&mut depth, pixel, p.z, point);
            }
        }
        let visible = self.unhidden(&drawn, size);
        ZBuffer {
            depth,
            index,
            visible,
        }
    }
}

#[cfg(test)]
mod tests;
