//! A triangle mesh with materials and textures, in the object frame once normalised.

use crate::image::RgbImage;
use nalgebra::Vector3;
use std::sync::Arc;

/// A texture image; its alpha, where it has one, in \[0, 1\], row-major like the image.
#[derive(Clone, Debug)]
pub struct Texture {
    pub image: RgbImage,
    pub alpha: Option<Vec<f32>>,
}

/// How a triangle is coloured.
#[derive(Clone, Debug)]
pub struct Material {
    /// RGB in \[0, 1\]; multiplies the texture where there is one.
    pub diffuse: [f32; 3],
    /// 1 = opaque.
    pub opacity: f32,
    pub texture: Option<Arc<Texture>>,
}

/// Indices into the mesh's vertices, and texture coordinates (u right, v up, repeating) per corner.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub vertices: [u32; 3],
    pub texture_coordinates: [[f32; 2]; 3],
    pub material: u32,
}

/// Triangles in no particular order; winding is not relied upon.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<Vector3<f64>>,
    pub triangles: Vec<Triangle>,
    pub materials: Vec<Material>,
}

impl Mesh {
    /// Moves and scales the mesh so that its bounding box is centred at the origin with diagonal 1: the
    /// canonical object frame, provided the axes are already +Y up and −Z front.
    pub fn normalise(&mut self) {
        let Some((low, high)) = self.bounds() else { return };
        let (centre, diagonal) = ((low + high) / 2.0, (high - low).norm());
        for vertex in &mut self.vertices {
            *vertex = (*vertex - centre) / diagonal;
        }
    }

    /// Lowest and highest corner of the bounding box over the vertices that triangles use; `None` if empty.
    pub fn bounds(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let mut used = self
            .triangles
            .iter()
            .flat_map(|t| t.vertices)
            .map(|i| self.vertices[i as usize]);
        let first = used.next()?;
        Some(used.fold((first, first), |(low, high), v| (low.inf(&v), high.sup(&v))))
    }

    /// Appends `other`, its vertices and materials renumbered.
    pub fn append(&mut self, other: Mesh) {
        let (vertex_base, material_base) = (self.vertices.len() as u32, self.materials.len() as u32);
        self.vertices.extend(other.vertices);
        self.materials.extend(other.materials);
        self.triangles
            .extend(other.triangles.into_iter().map(|t| Triangle {
                vertices: t.vertices.map(|i| i + vertex_base),
                material: t.material + material_base,
                ..t
            }));
    }
}
