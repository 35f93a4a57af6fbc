//! Binary glTF (`.glb`) with everything inside: triangles of the scene's nodes, base colours and their textures.

use super::archive::Archive;
use super::{CadError, Material, Mesh, Texture, Triangle, texture};
use crate::guard::guarded;
use gltf::image::Format;
use nalgebra::{Matrix4, Point3};
use std::path::Path;
use std::sync::Arc;

/// Far more than any model has; a node may be a child of many, and so a small file stand for a large one.
const MAX_NODES: usize = 100_000;
const MAX_CORNERS: usize = 100_000_000;

/// Reads the member `name` of `archive`. Vertices stay in the file's frame.
pub(super) fn read(archive: &mut Archive, name: &str) -> Result<Mesh, CadError> {
    let path = archive.path_of(name);
    let bytes = archive.read(name)?;
    // The library takes the file's own counts for granted.
    guarded(|| decode(&bytes, &path))
        .unwrap_or_else(|problem| Err(CadError::malformed(&path, "GLB", problem)))
}

fn decode(bytes: &[u8], path: &Path) -> Result<Mesh, CadError> {
    let (document, buffers, images) =
        gltf::import_slice(bytes).map_err(|error| CadError::malformed(path, "GLB", error))?;
    let textures: Vec<Arc<Texture>> = images
        .into_iter()
        .map(|image| texture_of(image, path).map(Arc::new))
        .collect::<Result<_, _>>()?;

    let mut mesh = Mesh {
        materials: document
            .materials()
            .map(|material| surface(&material, &textures))
            .collect(),
        ..Mesh::default()
    };
    // Primitives without a material.
    mesh.materials.push(Material {
        diffuse: [0.8; 3],
        opacity: 1.0,
        texture: None,
    });
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let nodes = scene.ok_or_else(|| CadError::malformed(path, "scenes", "none; export a scene"))?;
    // The library refuses node graphs with cycles, so this ends.
    let mut pending: Vec<_> = nodes.nodes().map(|node| (node, Matrix4::identity())).collect();
    pending.reverse();
    let mut visited = 0;
    while let Some((node, file_from_parent)) = pending.pop() {
        visited += 1;
        if visited > MAX_NODES || mesh.vertices.len().max(3 * mesh.triangles.len()) > MAX_CORNERS {
            return Err(CadError::malformed(
                path,
                "scenes",
                "too large; export fewer instances",
            ));
        }
        let local = Matrix4::from(node.transform().matrix()).cast::<f64>();
        let file_from_node = file_from_parent * local;
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            append(&mut mesh, &primitive, &buffers, &file_from_node, path)?;
        }
        pending.extend(node.children().map(|child| (child, file_from_node)));
    }
    Ok(mesh)
}

fn append(
    mesh: &mut Mesh,
    primitive: &gltf::Primitive,
    buffers: &[gltf::buffer::Data],
    file_from_node: &Matrix4<f64>,
    path: &Path,
) -> Result<(), CadError> {
    use gltf::mesh::Mode;
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| data.0.as_slice()));
    let positions = reader.read_positions().ok_or_else(|| {
        CadError::malformed(path, "POSITION", "none, or outside its buffer; export it again")
    })?;
    let base = mesh.vertices.len();
    mesh.vertices.extend(positions.map(|p| {
        file_from_node
            .transform_point(&Point3::from(p.map(f64::from)))
            .coords
    }));
    let count = mesh.vertices.len() - base;
    let corners: Vec<usize> = match reader.read_indices() {
        Some(indices) => indices.into_u32().map(|i| i as usize).collect(),
        None => (0..count).collect(),
    };
    if let Some(outside) = corners.iter().find(|&&i| i >= count) {
        let problem = format!("vertex {outside} of {count}");
        return Err(CadError::malformed(path, "indices", problem));
    }
    let uv: Vec<[f32; 2]> = reader
        .read_tex_coords(0)
        .map_or_else(Vec::new, |uv| uv.into_f32().collect());
    let triples: Vec<[usize; 3]> = match primitive.mode() {
        Mode::Triangles => corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        Mode::TriangleStrip => corners.windows(3).map(|t| [t[0], t[1], t[2]]).collect(),
        Mode::TriangleFan => corners
            .windows(2)
            .skip(1)
            .map(|t| [corners[0], t[0], t[1]])
            .collect(),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    };
    let default_material = mesh.materials.len() - 1;
    let material = primitive.material().index().unwrap_or(default_material) as u32;
    mesh.triangles.extend(triples.into_iter().map(|triple| Triangle {
        vertices: triple.map(|i| (base + i) as u32),
        // glTF has v down.
        texture_coordinates: triple.map(|i| uv.get(i).map_or([0.0; 2], |&[u, v]| [u, 1.0 - v])),
        material,
    }));
    Ok(())
}

fn surface(material: &gltf::Material, textures: &[Arc<Texture>]) -> Material {
    let look = material.pbr_metallic_roughness();
    let [red, green, blue, alpha] = look.base_color_factor();
    Material {
        // glTF's factors are linear light; textures and the other formats are not.
        diffuse: [red, green, blue].map(srgb_from_linear),
        opacity: if material.alpha_mode() == gltf::material::AlphaMode::Opaque {
            1.0
        } else {
            alpha
        },
        texture: look
            .base_color_texture()
            .and_then(|info| textures.get(info.texture().source().index()).cloned()),
    }
}

fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 {
        12.92 * value
    } else {
        1.055 * value.powf(1.0 / 2.4) - 0.055
    }
}

fn texture_of(image: gltf::image::Data, path: &Path) -> Result<Texture, CadError> {
    let channels = match image.format {
        Format::R8 => 1,
        Format::R8G8 => 2,
        Format::R8G8B8 => 3,
        Format::R8G8B8A8 => 4,
        other => {
            let problem = format!("{other:?}; give 8 bits a channel");
            return Err(CadError::malformed(path, "image", problem));
        }
    };
    let rgba = image
        .pixels
        .chunks_exact(channels)
        .map(|p| match *p {
            [grey] => [grey, grey, grey, 255],
            [grey, alpha] => [grey, grey, grey, alpha],
            [r, g, b] => [r, g, b, 255],
            [r, g, b, a] => [r, g, b, a],
            _ => [0; 4],
        })
        .collect();
    let (width, height) = (image.width as usize, image.height as usize);
    Ok(texture::from_rgba(width, height, rgba, channels % 2 == 0))
}

#[cfg(test)]
#[path = "glb_tests.rs"]
mod tests;
