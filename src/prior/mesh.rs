//! A closed triangle mesh that is symmetric in x = 0, stored as its half x ≥ 0.

use crate::geometry::mirror;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;

type V3 = Vector3<f64>;

/// How the vertices of a mirror-symmetric closed surface hang together.
///
/// The half's vertices come first. The whole has them, followed by the mirror images of those that do not lie on the seam.
#[derive(Clone, Debug, PartialEq)]
pub struct MirroredMesh {
    /// Faces of the half x ≥ 0, counter-clockwise seen from outside.
    faces: Vec<[u32; 3]>,
    /// Texture coordinates in \[0, 1\] per corner of the half's faces: u to the right, v up; u ≤ ½, the image's right half
    /// is the mirror image's.
    texture_coordinates: Vec<[[f32; 2]; 3]>,
    /// Per vertex of the half: the index of its mirror image in the whole, its own on the seam.
    image: Vec<u32>,
}

/// Why faces do not make the half of a closed surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidMesh {
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {vertex} of {vertices}")]
    NoVertex {
        /// The face's index.
        face: usize,
        /// The vertex that it names.
        vertex: u32,
        /// The vertices of the mesh.
        vertices: usize,
    },
    /// The mesh is no oriented manifold at an edge. The fields are the edge's vertices.
    #[error("edge {0}-{1} of the whole has more than two faces, or two that are wound differently")]
    NotManifold(u32, u32),
    /// A vertex belongs to no face. The field is its index.
    #[error("vertex {0} is of no face")]
    Unused(usize),
    /// There is not one triple of texture coordinates per face.
    #[error("{found} faces have texture coordinates, {expected} expected")]
    TextureCoordinates {
        /// The triples found.
        found: usize,
        /// The faces of the mesh.
        expected: usize,
    },
}

impl MirroredMesh {
    /// `faces` over `vertices` vertices. Those on the half's boundary are its seam.
    pub fn new(
        vertices: usize,
        faces: Vec<[u32; 3]>,
        texture_coordinates: Vec<[[f32; 2]; 3]>,
    ) -> Result<Self, InvalidMesh> {
        if texture_coordinates.len() != faces.len() {
            return Err(InvalidMesh::TextureCoordinates {
                found: texture_coordinates.len(),
                expected: faces.len(),
            });
        }
        let mut used = vec![false; vertices];
        let mut directed = BTreeMap::new();
        for (face, corners) in faces.iter().enumerate() {
            for (k, &vertex) in corners.iter().enumerate() {
                *used.get_mut(vertex as usize).ok_or(InvalidMesh::NoVertex {
                    face,
                    vertex,
                    vertices,
                })? = true;
                let next = corners[(k + 1) % 3];
                if directed.insert((vertex, next), ()).is_some() {
                    return Err(InvalidMesh::NotManifold(vertex, next));
                }
            }
        }
        if let Some(vertex) = used.iter().position(|used| !used) {
            return Err(InvalidMesh::Unused(vertex));
        }
        let mut seam = vec![false; vertices];
        for &(a, b) in directed.keys().filter(|(a, b)| !directed.contains_key(&(*b, *a))) {
            seam[a as usize] = true;
            seam[b as usize] = true;
        }
        // Both halves would share an edge across the half from seam to seam.
        let mut inner = directed.keys().filter(|(a, b)| directed.contains_key(&(*b, *a)));
        if let Some(&(a, b)) = inner.find(|(a, b)| seam[*a as usize] && seam[*b as usize]) {
            return Err(InvalidMesh::NotManifold(a, b));
        }
        let mut next = vertices as u32;
        let image = (0..vertices as u32)
            .map(|vertex| {
                if seam[vertex as usize] {
                    return vertex;
                }
                next += 1;
                next - 1
            })
            .collect();
        Ok(Self {
            faces,
            texture_coordinates,
            image,
        })
    }

    /// Vertices of the half.
    pub fn half_len(&self) -> usize {
        self.image.len()
    }

    /// Faces of the half, counter-clockwise seen from outside.
    pub fn half_faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Texture coordinates per corner of the half's faces.
    pub fn half_texture_coordinates(&self) -> &[[[f32; 2]; 3]] {
        &self.texture_coordinates
    }

    /// Whether a vertex of the half lies on the plane of symmetry, its own mirror image.
    pub fn on_seam(&self, vertex: usize) -> bool {
        self.image[vertex] as usize == vertex
    }

    /// Faces of the whole: those of the half, then their mirror images.
    pub fn faces(&self) -> Vec<[u32; 3]> {
        let mirrored = self
            .faces
            .iter()
            .map(|&[a, b, c]| [c, b, a].map(|v| self.image[v as usize]));
        self.faces.iter().copied().chain(mirrored).collect()
    }

    /// Texture coordinates of the whole's faces, in the order of [`MirroredMesh::faces`].
    pub fn texture_coordinates(&self) -> Vec<[[f32; 2]; 3]> {
        let mirrored = self
            .texture_coordinates
            .iter()
            .map(|&[a, b, c]| [c, b, a].map(|[u, v]| [1.0 - u, v]));
        self.texture_coordinates.iter().copied().chain(mirrored).collect()
    }

    /// The whole's vertices from those of the half, if the shape is symmetric.
    pub fn whole(&self, half: &[V3]) -> Vec<V3> {
        let others = (0..half.len()).filter(|&v| !self.on_seam(v));
        half.iter()
            .copied()
            .chain(others.map(|v| mirror(&half[v])))
            .collect()
    }

    /// Edges of the half, each once, lower vertex first.
    pub fn half_edges(&self) -> Vec<[usize; 2]> {
        let mut edges: Vec<[usize; 2]> = self
            .faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b) as usize, a.max(b) as usize])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Outward unit normals at the half's vertices, weighted by area; on the seam they have no x.
    pub fn half_normals(&self, half: &[V3]) -> Vec<V3> {
        let mut normals = vec![V3::zeros(); half.len()];
        for face in &self.faces {
            let cross = area_normal(half, face);
            face.iter().for_each(|&v| normals[v as usize] += cross);
        }
        for (vertex, normal) in normals.iter_mut().enumerate() {
            if self.on_seam(vertex) {
                normal.x = 0.0;
            }
            *normal = normal.try_normalize(1e-18).unwrap_or(V3::y());
        }
        normals
    }
}

/// Every face cut into four at the middles of its edges: the same surface by more vertices, those given first.
pub fn subdivided(vertices: &[V3], faces: &[[u32; 3]]) -> (Vec<V3>, Vec<[u32; 3]>) {
    let mut vertices = vertices.to_vec();
    let mut middles = BTreeMap::new();
    let mut fine = Vec::with_capacity(4 * faces.len());
    for &[a, b, c] in faces {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[a, b]| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]) / 2.0);
                vertices.len() as u32 - 1
            })
        });
        fine.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (vertices, fine)
}

/// Lowest and highest corner of the box beyond each face of which lies `beyond` of the surface; `None` where it has no area.
pub(super) fn body_box(vertices: &[V3], faces: &[[u32; 3]], beyond: f64) -> Option<(V3, V3)> {
    let areas: Vec<f64> = faces
        .iter()
        .map(|face| area_normal(vertices, face).norm())
        .collect();
    let middles: Vec<V3> = faces
        .iter()
        .map(|face| face.iter().map(|&v| vertices[v as usize]).sum::<V3>() / 3.0)
        .collect();
    let total: f64 = areas.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let (mut low, mut high) = (V3::zeros(), V3::zeros());
    for axis in 0..3 {
        let along = |sign: f64| {
            middles
                .iter()
                .map(move |middle| sign * middle[axis])
                .zip(areas.iter().copied())
        };
        low[axis] = first_beyond(along(1.0).collect(), beyond * total)?;
        high[axis] = -first_beyond(along(-1.0).collect(), beyond * total)?;
    }
    Some((low, high))
}

/// The least coordinate up to which there is more than `area`, of faces' coordinates and areas.
fn first_beyond(mut faces: Vec<(f64, f64)>, mut area: f64) -> Option<f64> {
    let mut rest = &mut faces[..];
    while rest.len() > 1 {
        // Few faces are sought.
        let cut = rest.len().div_ceil(8);
        let (below, _, _) = rest.select_nth_unstable_by(cut, |a, b| a.0.total_cmp(&b.0));
        let area_below: f64 = below.iter().map(|face| face.1).sum();
        rest = if area < area_below {
            &mut rest[..cut]
        } else {
            area -= area_below;
            &mut rest[cut..]
        };
    }
    rest.first().filter(|face| area < face.1).map(|face| face.0)
}

/// Writes an OBJ file.
pub fn write_mesh(path: &Path, vertices: &[V3], faces: &[[u32; 3]]) -> std::io::Result<()> {
    let mut text = String::new();
    for v in vertices {
        text += &format!("v {:.6} {:.6} {:.6}\n", v.x, v.y, v.z);
    }
    for [a, b, c] in faces.iter().map(|face| face.map(|v| v + 1)) {
        text += &format!("f {a} {b} {c}\n");
    }
    crate::files::write_whole(path, text.as_bytes())
}

/// Twice the area of a face, along its normal.
pub(super) fn area_normal(vertices: &[V3], face: &[u32; 3]) -> V3 {
    let [a, b, c] = face.map(|v| vertices[v as usize]);
    (b - a).cross(&(c - a))
}

/// How a mesh bent onto a shape looks, against the mesh as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Share of the faces that [`turned_over`] names.
    pub folded: f64,
    /// Share of the faces stretched three times as much in one direction as in the other.
    pub stretched: f64,
    /// The growth in area that all but 5 % of the faces exceed, and that 5 % exceed: their ratio.
    pub area_spread: f64,
}

/// Compares the half `bent` with the half at `rest`.
pub fn distortion(mesh: &MirroredMesh, rest: &[V3], bent: &[V3]) -> Distortion {
    let faces = mesh.half_faces();
    let stretch: Vec<[f64; 2]> = faces
        .iter()
        .map(|face| singular_values(face.map(|v| rest[v as usize]), face.map(|v| bent[v as usize])))
        .collect();
    let share = |count: usize| count as f64 / faces.len().max(1) as f64;
    let mut areas: Vec<f64> = stretch.iter().map(|[large, small]| large * small).collect();
    areas.sort_by(f64::total_cmp);
    let at = |part: f64| {
        areas
            .get((part * areas.len() as f64) as usize)
            .copied()
            .unwrap_or(1.0)
    };
    let folded = turned_over(mesh, rest, bent);
    Distortion {
        folded: share(folded.iter().filter(|&&folded| folded).count()),
        stretched: share(
            stretch
                .iter()
                .filter(|[large, small]| *large > 3.0 * small)
                .count(),
        ),
        area_spread: at(0.95) / at(0.05).max(1e-12),
    }
}

/// Which faces of the half came to lie the wrong way: more than 120° from where they faced at rest, or from a neighbour that they were
/// less than 60° from at rest.
pub fn turned_over(mesh: &MirroredMesh, rest: &[V3], bent: &[V3]) -> Vec<bool> {
    let faces = mesh.half_faces();
    let normals = |half: &[V3]| -> Vec<V3> {
        let normal = |face| area_normal(half, face).try_normalize(1e-18).unwrap_or_default();
        faces.iter().map(normal).collect()
    };
    let (before, after) = (normals(rest), normals(bent));
    let mut wrong: Vec<bool> = before.iter().zip(&after).map(|(b, a)| a.dot(b) < -0.5).collect();
    let mut first = BTreeMap::new();
    for (index, &[a, b, c]) in faces.iter().enumerate() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let edge = (from.min(to), from.max(to));
            let Some(other) = first.insert(edge, index) else {
                continue;
            };
            if after[index].dot(&after[other]) < -0.5 && before[index].dot(&before[other]) > 0.5 {
                wrong[index] = true;
                wrong[other] = true;
            }
        }
    }
    wrong
}

/// How much a triangle is stretched along and across, larger first.
fn singular_values(rest: [V3; 3], bent: [V3; 3]) -> [f64; 2] {
    let (u, v) = (rest[1] - rest[0], rest[2] - rest[0]);
    let length = u.norm().max(1e-12);
    let along = v.dot(&u) / length;
    let across = (v - u * (along / length)).norm().max(1e-12);
    let (p, q) = (bent[1] - bent[0], bent[2] - bent[0]);
    // The columns of the 3 × 2 matrix that maps the flat triangle onto the bent one.
    let first = p / length;
    let second = (q - first * along) / across;
    let (a, b, c) = (first.norm_squared(), first.dot(&second), second.norm_squared());
    let root = ((a - c).powi(2) / 4.0 + b * b).sqrt();
    [(a + c) / 2.0 + root, (a + c) / 2.0 - root].map(|square| square.max(0.0).sqrt())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A half of the octahedron: one face a quadrant of x ≥ 0, the seam being the four corners in x = 0.
    pub(crate) fn half_octahedron() -> (MirroredMesh, Vec<V3>) {
        let corners = [V3::x(), V3::y(), V3::z(), -V3::y(), -V3::z()].map(|v| v * 0.5);
        let faces = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let flat = vec![[[0.0, 0.0], [0.5, 0.0], [0.0, 1.0]]; 4];
        (MirroredMesh::new(5, faces, flat).unwrap(), corners.into())
    }

    #[test]
    fn the_whole_is_closed_and_faces_out() {
        let (mesh, half) = half_octahedron();
        let (faces, whole) = (mesh.faces(), mesh.whole(&half));
        assert_eq!((faces.len(), whole.len()), (8, 6));
        let volume: f64 = faces
            .iter()
            .map(|f| whole[f[0] as usize].dot(&area_normal(&whole, f)) / 6.0)
            .sum();
        assert!((volume - 1.0 / 6.0).abs() < 1e-12, "{volume}");
        let closed = MirroredMesh::new(6, faces, vec![[[0.0; 2]; 3]; 8]).unwrap();
        assert!((0..6).all(|v| !closed.on_seam(v)));
        assert_eq!(mesh.half_normals(&half)[0], V3::x());
        assert_eq!(mesh.half_normals(&half)[1], V3::y());
    }

    #[test]
    fn a_subdivided_surface_is_the_same() {
        let (mesh, half) = half_octahedron();
        let (whole, faces) = (mesh.whole(&half), mesh.faces());
        let (fine, fine_faces) = subdivided(&whole, &faces);
        // 12 edges; closed: V − E + F = 2.
        assert_eq!((fine.len(), fine_faces.len()), (6 + 12, 32));
        let area = |vertices: &[V3], faces: &[[u32; 3]]| -> V3 {
            faces.iter().map(|f| area_normal(vertices, f).abs()).sum()
        };
        assert!((area(&whole, &faces) - area(&fine, &fine_faces)).norm() < 1e-12);
    }

    #[test]
    fn the_body_s_box_leaves_a_share_of_the_surface_out() {
        let (mesh, half) = half_octahedron();
        let (mut vertices, mut faces) = (mesh.whole(&half), mesh.faces());
        for _ in 0..5 {
            (vertices, faces) = subdivided(&vertices, &faces);
        }
        // Of an octahedron with corners at ±½, the tip beyond x = ½ (1 − √0.02) is one hundredth.
        let expected = 0.5 * (1.0 - 0.02_f64.sqrt());
        let (low, high) = body_box(&vertices, &faces, 0.01).unwrap();
        for axis in 0..3 {
            assert!(
                (high[axis] - expected).abs() < 0.01 && (low[axis] + high[axis]).abs() < 0.01,
                "{low} {high}"
            );
        }
        assert_eq!(body_box(&[V3::x(); 3], &[[0, 1, 2]], 0.01), None);
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        let flat = |n| vec![[[0.0; 2]; 3]; n];
        let refused = |faces: Vec<[u32; 3]>| {
            let count = faces.len();
            MirroredMesh::new(4, faces, flat(count)).unwrap_err()
        };
        assert!(matches!(
            refused(vec![[0, 1, 9]]),
            InvalidMesh::NoVertex { vertex: 9, .. }
        ));
        assert_eq!(
            refused(vec![[0, 1, 2], [0, 1, 3]]),
            InvalidMesh::NotManifold(0, 1)
        );
        // Its mirror image has the edge from seam to seam, too.
        assert_eq!(
            refused(vec![[0, 1, 2], [1, 3, 2]]),
            InvalidMesh::NotManifold(1, 2)
        );
        assert_eq!(refused(vec![[0, 1, 2]]), InvalidMesh::Unused(3));
    }

    #[test]
    fn folds_and_stretch_are_counted() {
        // Four triangles around the middle of a square.
        let faces = vec![[0, 1, 4], [1, 3, 4], [3, 2, 4], [2, 0, 4]];
        let mesh = MirroredMesh::new(5, faces, vec![[[0.0; 2]; 3]; 4]).unwrap();
        let corner = V3::x() + V3::y();
        let rest = [V3::zeros(), V3::x(), V3::y(), corner, 0.5 * corner];
        assert_eq!(distortion(&mesh, &rest, &rest).folded, 0.0);
        let mut bent = rest;
        bent[3] = V3::new(0.3, 0.3, 0.01);
        assert_eq!(distortion(&mesh, &rest, &bent).folded, 1.0);
        let long = rest.map(|v| V3::new(4.0 * v.x, v.y, 0.0));
        let found = distortion(&mesh, &rest, &long);
        assert_eq!((found.folded, found.stretched), (0.0, 1.0));
        let [large, small] = singular_values([rest[0], rest[1], rest[2]], [long[0], long[1], long[2]]);
        assert!((large - 4.0).abs() < 1e-12 && (small - 1.0).abs() < 1e-12);
    }
}
