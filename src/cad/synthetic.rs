//! Shapes for the tests: car-like boxes with known symmetry.

use crate::cad::{Mesh, Triangle};
use nalgebra::Vector3;

/// An axis-aligned box of the given centre and full size.
pub fn cuboid(centre: Vector3<f64>, size: Vector3<f64>) -> Mesh {
    let vertices = (0..8)
        .map(|i| {
            let corner = Vector3::new(f64::from(i & 1), f64::from((i >> 1) & 1), f64::from(i >> 2));
            centre + (corner - Vector3::repeat(0.5)).component_mul(&size)
        })
        .collect();
    let quads = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|vertices| Triangle {
            vertices,
            texture_coordinates: [[0.0; 2]; 3],
            material: 0,
        })
        .collect();
    Mesh {
        vertices,
        triangles,
        materials: Vec::new(),
    }
}

/// A box with a cabin of the given height and place along z, normalised.
pub fn toy_car(cabin_height: f64, cabin_z: f64, width: f64) -> Mesh {
    let mut mesh = cuboid(Vector3::zeros(), Vector3::new(width, 0.2, 1.0));
    let cabin = Vector3::new(width * 0.8, cabin_height, 0.4);
    mesh.append(cuboid(
        Vector3::new(0.0, 0.1 + cabin_height / 2.0, cabin_z),
        cabin,
    ));
    mesh.normalise();
    mesh
}
