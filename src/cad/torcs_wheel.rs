//! Wheels of TORCS cars: newer cars share modelled ones, older cars have a textured disc on a cylinder.
//!
//! Both are made with the axle along z and the outer face towards −z (the left side of a car that faces +x).

use super::archive::Archive;
use super::{CadError, Material, Mesh, Triangle, ac3d};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// In the AC3D frame of TORCS (x forward, y up, z right), metres.
pub(super) struct Wheel {
    pub(super) centre: [f64; 3],
    pub(super) radius: f64,
    pub(super) width: f64,
}

/// A shared wheel of diameter 1 and width 1, scaled and placed.
pub(super) fn modelled(archive: &mut Archive, name: &str, wheel: &Wheel) -> Result<Mesh, CadError> {
    let mut mesh = ac3d::read(archive, name)?;
    place(
        &mut mesh,
        wheel,
        Vector3::new(2.0 * wheel.radius, 2.0 * wheel.radius, wheel.width),
    );
    Ok(mesh)
}

/// A dark cylinder with the standing wheel of the texture (its top left quarter; the others are motion-blurred) on
/// the outer face.
pub(super) fn plain(archive: &mut Archive, texture: &str, wheel: &Wheel) -> Result<Mesh, CadError> {
    const SIDES: u32 = 32;
    const TYRE: u32 = 0;
    const FACE: u32 = 1;
    let tyre = Material {
        diffuse: [0.08; 3],
        opacity: 1.0,
        texture: None,
    };
    let face = Material {
        diffuse: [1.0; 3],
        opacity: 1.0,
        texture: archive.texture(texture)?,
    };
    // The face floats a little before the tyre's side, which shows where the texture is transparent.
    const RINGS: [f64; 3] = [-0.5, 0.5, -0.51];
    let mut mesh = Mesh {
        materials: vec![tyre, face],
        ..Mesh::default()
    };
    for z in RINGS {
        mesh.vertices.push(Vector3::new(0.0, 0.0, z));
        mesh.vertices.extend((0..SIDES).map(|i| {
            let (sin, cos) = (f64::from(i) / f64::from(SIDES) * TAU).sin_cos();
            Vector3::new(cos, sin, z)
        }));
    }
    let vertex = |ring: u32, side: u32| ring * (SIDES + 1) + 1 + side % SIDES;
    let hub = |ring: u32| ring * (SIDES + 1);
    let mut push = |vertices: [u32; 3], material: u32| {
        let texture_coordinates = vertices.map(|i| {
            let at = mesh.vertices[i as usize];
            // Seen from outside (−z), x points left.
            [0.25 - 0.25 * at.x as f32, 0.75 + 0.25 * at.y as f32]
        });
        mesh.triangles.push(Triangle {
            vertices,
            texture_coordinates,
            material,
        });
    };
    for side in 0..SIDES {
        push([hub(0), vertex(0, side + 1), vertex(0, side)], TYRE);
        push([hub(1), vertex(1, side), vertex(1, side + 1)], TYRE);
        push([vertex(0, side), vertex(0, side + 1), vertex(1, side)], TYRE);
        push([vertex(1, side), vertex(0, side + 1), vertex(1, side + 1)], TYRE);
        push([hub(2), vertex(2, side + 1), vertex(2, side)], FACE);
    }
    place(
        &mut mesh,
        wheel,
        Vector3::new(wheel.radius, wheel.radius, wheel.width),
    );
    Ok(mesh)
}

fn place(mesh: &mut Mesh, wheel: &Wheel, scale: Vector3<f64>) {
    let centre = Vector3::from(wheel.centre);
    let turn = if centre.z > 0.0 { -1.0 } else { 1.0 };
    for vertex in &mut mesh.vertices {
        let scaled = vertex.component_mul(&scale);
        // Half a turn about y, not a mirror image, for the right side.
        *vertex = centre + Vector3::new(turn * scaled.x, scaled.y, turn * scaled.z);
    }
}
