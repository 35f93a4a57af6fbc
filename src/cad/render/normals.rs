//! Normals at triangle corners, smooth across soft edges, without relying on the winding.

use super::super::Mesh;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Faces that meet at a sharper angle than this keep an edge: cos 40°.
const CREASE_COSINE: f64 = 0.766;

/// For each corner of each triangle: the area-weighted mean of the faces around it that lie within the crease
/// angle, each turned to the triangle's own side. Unit length; zero for triangles without area.
pub(in crate::cad) fn corner_normals(mesh: &Mesh) -> Vec<[Vector3<f64>; 3]> {
    // Twice the area times the unit normal.
    let faces: Vec<Vector3<f64>> = mesh
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.vertices.map(|i| mesh.vertices[i as usize]);
            (b - a).cross(&(c - a))
        })
        .collect();
    // Files repeat a vertex where its texture coordinates differ, so faces meet by position.
    let mut around: BTreeMap<[u64; 3], Vec<usize>> = BTreeMap::new();
    let place = |vertex: u32| {
        let at = mesh.vertices[vertex as usize];
        // + 0.0 makes −0 and 0 one place.
        [at.x + 0.0, at.y + 0.0, at.z + 0.0].map(f64::to_bits)
    };
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        for vertex in triangle.vertices {
            around.entry(place(vertex)).or_default().push(i);
        }
    }
    mesh.triangles
        .iter()
        .zip(&faces)
        .map(|(triangle, own)| {
            let own = own.try_normalize(0.0).unwrap_or_default();
            triangle.vertices.map(|vertex| {
                let faces_here = around.get(&place(vertex)).into_iter().flatten();
                let sum: Vector3<f64> = faces_here
                    .map(|&i| {
                        let cosine = faces[i].try_normalize(0.0).unwrap_or_default().dot(&own);
                        if cosine.abs() < CREASE_COSINE {
                            Vector3::zeros()
                        } else {
                            faces[i] * cosine.signum()
                        }
                    })
                    .sum();
                sum.try_normalize(0.0).unwrap_or(own)
            })
        })
        .collect()
}
