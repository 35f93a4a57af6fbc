//! What Blender is told: `scene.json` and one PNG a texture. Object frame; lengths in object diagonals.

use super::super::render::{HOLE, Light, NEAR, UNPAINTED, Viewpoint, corner_normals, is_hole};
use super::super::{CadError, Material, Mesh, Texture};
use super::failed;
use nalgebra::Vector3;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// The whole of `scene.json`.
#[derive(Serialize)]
struct Description {
    width: usize,
    height: usize,
    /// Rays a pixel.
    samples: usize,
    /// Nearer surfaces are not drawn.
    near: f64,
    /// The opacity below which surfaces are not drawn.
    hole: f32,
    /// The positions of three corners a triangle, x y z each.
    corners: Vec<f64>,
    /// The normals of three corners a triangle, x y z each.
    normals: Vec<f64>,
    /// The texture coordinates of three corners a triangle, u v each.
    texture_coordinates: Vec<f32>,
    /// An index into `materials` a triangle.
    material: Vec<usize>,
    materials: Vec<Surface>,
    views: Vec<Shot>,
}

#[derive(Serialize)]
struct Surface {
    diffuse: [f32; 3],
    opacity: f32,
    /// A file beside `scene.json`.
    texture: Option<String>,
}

/// `camera_from_object`, rows first; focal length and principal point in pixels.
#[derive(Serialize)]
struct Shot {
    focal: f64,
    principal: [f64; 2],
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    light: ObjectLight,
}

#[derive(Serialize)]
struct ObjectLight {
    direction: [f64; 3],
    ambient: f64,
    diffuse: f64,
}

/// Writes all that `render.py` reads. The views are of one size and have square pixels.
pub(super) fn write(
    mesh: &Mesh,
    shots: &[(Viewpoint, Light)],
    samples_per_axis: usize,
    folder: &Path,
) -> Result<(), CadError> {
    let kept = without_copies(mesh);
    let triangles = || kept.iter().map(|&i| &mesh.triangles[i]);
    let all_normals = corner_normals(mesh);
    let (width, height) = shots
        .first()
        .map_or((0, 0), |(view, _)| (view.width, view.height));
    let corners = triangles().flat_map(|triangle| triangle.vertices);
    let description = Description {
        width,
        height,
        samples: samples_per_axis * samples_per_axis,
        near: NEAR,
        hole: HOLE,
        corners: corners
            .flat_map(|vertex| <[f64; 3]>::from(mesh.vertices[vertex as usize]))
            .collect(),
        normals: kept
            .iter()
            .flat_map(|&i| all_normals[i])
            .flat_map(<[f64; 3]>::from)
            .collect(),
        texture_coordinates: triangles()
            .flat_map(|triangle| triangle.texture_coordinates)
            .flatten()
            .collect(),
        // The one after the mesh's own stands for a missing one.
        material: triangles()
            .map(|triangle| (triangle.material as usize).min(mesh.materials.len()))
            .collect(),
        materials: surfaces(mesh, folder)?,
        views: shots.iter().map(shot).collect(),
    };
    let text = serde_json::to_string(&description).map_err(|error| failed(error.to_string()))?;
    std::fs::write(folder.join("scene.json"), text).map_err(|error| {
        failed(format!(
            "scene.json cannot be written ({error}); check the free space"
        ))
    })
}

fn shot((view, light): &(Viewpoint, Light)) -> Shot {
    let (pose, light) = (
        &view.camera_from_object,
        light.in_object(&view.camera_from_object),
    );
    Shot {
        focal: view.camera.fx,
        principal: [view.camera.cx, view.camera.cy],
        rotation: std::array::from_fn(|row| std::array::from_fn(|column| pose.rotation[(row, column)])),
        translation: pose.translation.into(),
        light: ObjectLight {
            direction: light.direction.into_inner().into(),
            ambient: light.ambient,
            diffuse: light.diffuse,
        },
    }
}

/// The triangles but for those with the very corners of an earlier one that hides them, such as the lining of a roof
/// without thickness: of two surfaces in one place ours shows the first, a ray tracer any.
fn without_copies(mesh: &Mesh) -> Vec<usize> {
    let middle = Vector3::repeat(1.0 / 3.0);
    let mut hiding = BTreeSet::new();
    let kept = |&i: &usize| {
        let triangle = &mesh.triangles[i];
        // + 0.0 makes −0 and 0 one place.
        let place =
            |vertex: u32| <[f64; 3]>::from(mesh.vertices[vertex as usize]).map(|x| (x + 0.0).to_bits());
        let mut corners = triangle.vertices.map(place);
        corners.sort_unstable();
        let hidden = hiding.contains(&corners);
        if !is_hole(mesh, triangle, &middle) {
            hiding.insert(corners);
        }
        !hidden
    };
    (0..mesh.triangles.len()).filter(kept).collect()
}

/// The mesh's materials, their textures written once each, and a plain one.
fn surfaces(mesh: &Mesh, folder: &Path) -> Result<Vec<Surface>, CadError> {
    let mut written: Vec<&Arc<Texture>> = Vec::new();
    let mut surfaces = Vec::with_capacity(mesh.materials.len() + 1);
    for Material {
        diffuse,
        opacity,
        texture,
    } in &mesh.materials
    {
        let mut file = None;
        if let Some(texture) = texture {
            let known = written.iter().position(|other| Arc::ptr_eq(other, texture));
            let number = known.unwrap_or(written.len());
            let name = format!("texture-{number}.png");
            if known.is_none() {
                write_texture(texture, &folder.join(&name))?;
                written.push(texture);
            }
            file = Some(name);
        }
        surfaces.push(Surface {
            diffuse: *diffuse,
            opacity: *opacity,
            texture: file,
        });
    }
    surfaces.push(Surface {
        diffuse: [UNPAINTED / 255.0; 3],
        opacity: 1.0,
        texture: None,
    });
    Ok(surfaces)
}

fn write_texture(texture: &Texture, file: &Path) -> Result<(), CadError> {
    let byte = |value: f32| value.round().clamp(0.0, 255.0) as u8;
    let (width, height) = texture.image.size();
    let alpha = |i: usize| texture.alpha.as_ref().map_or(255, |alpha| byte(255.0 * alpha[i]));
    let pixels = texture.image.data().iter().enumerate();
    let bytes: Vec<u8> = pixels
        .flat_map(|(i, &[r, g, b])| [byte(r), byte(g), byte(b), alpha(i)])
        .collect();
    image::save_buffer(
        file,
        &bytes,
        width as u32,
        height as u32,
        image::ExtendedColorType::Rgba8,
    )
    .map_err(|error| failed(format!("{} cannot be written ({error})", file.display())))
}
