//! A triangle mesh with materials and textures, in the object frame once normalised.

use super::sample_outside;
use crate::geometry::BODY_BEYOND;
use crate::image::RgbImage;
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Draws for the box of the body.
const BODY_SAMPLES: usize = 20_000;
/// A vertex so many times farther from the middle than the others is none of the object's.
const OUT_OF_PROPORTION: f64 = 1e3;

/// A texture image; its alpha, where it has one, in \[0, 1\], row-major like the image.
#[derive(Clone, Debug)]
pub struct Texture {
    /// The colours, RGB in \[0, 255\].
    pub image: RgbImage,
    /// The opacity of every pixel, in \[0, 1\], row-major; `None` where the file has no alpha channel.
    pub alpha: Option<Vec<f32>>,
}

/// How a triangle is coloured.
#[derive(Clone, Debug)]
pub struct Material {
    /// RGB in \[0, 1\]; multiplies the texture where there is one.
    pub diffuse: [f32; 3],
    /// 1 = opaque.
    pub opacity: f32,
    /// The texture that `diffuse` multiplies; `None` for a plain colour.
    pub texture: Option<Arc<Texture>>,
}

/// Indices into the mesh's vertices, and texture coordinates (u right, v up, repeating) per corner.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Indices into [`Mesh::vertices`], one per corner.
    pub vertices: [u32; 3],
    /// Texture coordinates (u, v), one pair per corner.
    pub texture_coordinates: [[f32; 2]; 3],
    /// An index into [`Mesh::materials`].
    pub material: u32,
}

/// Triangles in no particular order; winding is not relied upon.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions. [`NamedModel`](super::NamedModel) says in which frame.
    pub vertices: Vec<Vector3<f64>>,
    /// The triangles.
    pub triangles: Vec<Triangle>,
    /// The materials that triangles name.
    pub materials: Vec<Material>,
}

impl Mesh {
    /// Whether its shape can be told: every vertex in use finite, and none so far off that the others shrink to a point.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        let used: BTreeSet<u32> = self.triangles.iter().flat_map(|t| t.vertices).collect();
        let position = |index: u32| self.vertices.get(index as usize);
        if let Some(index) = used
            .iter()
            .find(|&&index| position(index).is_none_or(|v| !v.iter().all(|x| x.is_finite())))
        {
            return Err(format!("vertex {} is not finite", index + 1));
        }
        let middle = |values: &mut Vec<f64>| {
            let half = values.len() / 2;
            *values.select_nth_unstable_by(half, f64::total_cmp).1
        };
        if used.is_empty() {
            return Ok(());
        }
        let along = |axis: usize| -> Vec<f64> {
            used.iter()
                .filter_map(|&index| Some(position(index)?[axis]))
                .collect()
        };
        let centre = Vector3::from_fn(|axis, _| middle(&mut along(axis)));
        let away = |index: u32| position(index).map_or(0.0, |vertex| (vertex - centre).norm());
        let usual = middle(&mut used.iter().map(|&index| away(index)).collect());
        match used
            .iter()
            .find(|&&index| away(index) > OUT_OF_PROPORTION * usual)
        {
            Some(&index) if usual > 0.0 => Err(format!(
                "vertex {} is {:.0e} times farther away than the others",
                index + 1,
                away(index) / usual
            )),
            _ => Ok(()),
        }
    }

    /// Moves and scales the mesh so that the box of its body is centred at the origin with diagonal 1: the
    /// canonical object frame, provided the axes are already +Y up and −Z front.
    ///
    /// Beyond each face of that box lies 1 % of the mesh's outside. The bounding box proper would let an antenna or
    /// a pair of mirrors decide where the object is and how large.
    pub fn normalise(&mut self) {
        // Sampling wants a mesh of about unit size.
        let Some((low, high)) = self.bounds() else { return };
        self.fit_box(&low, &high);
        let outside = sample_outside(self, BODY_SAMPLES, 0).points;
        if let Some((low, high)) = body_box(&outside) {
            self.fit_box(&low, &high);
        }
    }

    /// Moves and scales the mesh so that the box from `low` to `high` is centred at the origin with diagonal 1.
    fn fit_box(&mut self, low: &Vector3<f64>, high: &Vector3<f64>) {
        let (centre, diagonal) = ((low + high) / 2.0, (high - low).norm());
        if diagonal > 0.0 {
            for vertex in &mut self.vertices {
                *vertex = (*vertex - centre) / diagonal;
            }
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

/// Lowest and highest corner of the box beyond each face of which 1 % of `outside` lies; `None` if that is empty.
pub(crate) fn body_box(outside: &[Vector3<f64>]) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let beyond = (BODY_BEYOND * outside.len() as f64) as usize;
    let last = outside.len().checked_sub(1 + beyond)?;
    let sorted: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let mut along: Vec<f64> = outside.iter().map(|point| point[axis]).collect();
        along.sort_unstable_by(f64::total_cmp);
        along
    });
    let corner = |index: usize| Vector3::from_fn(|axis, _| sorted[axis][index]);
    Some((corner(beyond), corner(last)))
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::cuboid;
    use super::*;

    #[test]
    fn vertices_that_are_nowhere_or_far_out_are_told() {
        let mut body = cuboid(Vector3::new(3.0, 4.0, 5.0), Vector3::new(4.0, 2.0, 8.0));
        assert_eq!(body.check(), Ok(()));
        // What no triangle uses does not count.
        body.vertices.push(Vector3::repeat(f64::NAN));
        assert_eq!(body.check(), Ok(()));
        let first = body.triangles[0].vertices[0];
        for (at, words) in [
            (f64::NAN, "not finite"),
            (f64::INFINITY, "not finite"),
            (1e30, "times farther away"),
        ] {
            let mut body = body.clone();
            body.vertices[first as usize].x = at;
            let problem = body.check().unwrap_err();
            assert!(
                problem.contains(words) && problem.contains(&format!("vertex {} ", first + 1)),
                "{problem}"
            );
        }
    }

    #[test]
    fn the_canonical_frame_is_the_body_s() {
        let mut body = cuboid(Vector3::new(3.0, 4.0, 5.0), Vector3::new(4.0, 2.0, 8.0));
        let mut with_antenna = body.clone();
        with_antenna.append(cuboid(Vector3::new(3.0, 5.5, 7.0), Vector3::new(0.01, 1.0, 0.01)));
        body.normalise();
        with_antenna.normalise();
        let (low, high) = body.bounds().unwrap();
        assert!(((high - low).norm() - 1.0).abs() < 0.02 && (high + low).norm() < 0.01);
        assert!(
            (high - low)
                .normalize()
                .dot(&Vector3::new(4.0, 2.0, 8.0).normalize())
                > 1.0 - 1e-9
        );
        for (a, b) in body.vertices.iter().zip(&with_antenna.vertices) {
            assert!((a - b).norm() < 0.005, "{a} {b}");
        }
    }
}
