//! The surface that points lie on, which hides what lies behind it (ours).

use crate::geometry::{Pinhole, Pose, Vector3};
use crate::prior::ShapePrior;
use crate::surface::{ClosedMesh, Facets, InCamera, Mesh, Projected};

/// Behind a mesh by more, object units, points are hidden: small folds, which a bent mesh has, hide nothing.
const MESH_TOLERANCE: f64 = 2e-3;

/// What hides points. Depends on the shape only: one serves all frames.
#[derive(Clone, Debug)]
pub enum Cover {
    /// The closed mesh that the points lie on.
    Mesh(ClosedMesh),
    /// Triangles between neighbours of points of which no surface is known.
    Facets {
        /// The points and the triangles.
        mesh: Mesh,
        /// What lies between points, object units. A triangle may stand out before a point by its sag, which is less.
        spacing: f64,
    },
}

impl Cover {
    /// Triangles between neighbours of `points` (xyz after xyz, object frame).
    pub fn around(points: &[f64]) -> Self {
        let vertices = vectors(points);
        let Facets { faces, spacing, .. } = Facets::around(&vertices);
        Self::Facets {
            mesh: Mesh { vertices, faces },
            spacing,
        }
    }

    /// What hides `points`, the prior's first at `style`.
    pub fn of(prior: &dyn ShapePrior, style: &[f64], points: &[f64]) -> Self {
        match prior.mesh(style) {
            Some(mesh) => Self::Mesh(ClosedMesh::new(mesh)),
            None => Self::around(points),
        }
    }

    /// What hides `points` at `style`, where this is what hides them at another: a style moves neighbours together.
    pub fn at(&self, prior: &dyn ShapePrior, style: &[f64], points: &[f64]) -> Self {
        match self {
            Self::Mesh(_) => Self::of(prior, style, points),
            Self::Facets { mesh, spacing } => Self::Facets {
                mesh: Mesh {
                    vertices: vectors(points),
                    faces: mesh.faces.clone(),
                },
                spacing: *spacing,
            },
        }
    }

    /// Per point: whether it lies behind a triangle. Points outside the image are not looked at.
    pub(super) fn hidden(
        &self,
        points: &[Option<Projected>],
        camera: &Pinhole,
        camera_from_object: &Pose,
        size: (usize, usize),
    ) -> Vec<bool> {
        match self {
            Self::Mesh(mesh) => {
                InCamera::of_closed(mesh, camera, camera_from_object).hidden(points, size, MESH_TOLERANCE)
            }
            Self::Facets { mesh, spacing } => {
                InCamera::new(&mesh.vertices, &mesh.faces, camera, camera_from_object)
                    .hidden(points, size, *spacing)
            }
        }
    }
}

pub(super) fn vectors(points: &[f64]) -> Vec<Vector3<f64>> {
    points.chunks_exact(3).map(Vector3::from_column_slice).collect()
}
