//! Wavefront OBJ with MTL, through `tobj`.

use super::archive::{Archive, beside};
use super::{CadError, Material, Mesh, Triangle};
use nalgebra::Vector3;
use std::cell::RefCell;
use std::io::Cursor;

/// Reads the member `name` of `archive`; materials and textures are looked for beside it.
pub(super) fn read(archive: &mut Archive, name: &str) -> Result<Mesh, CadError> {
    let path = archive.path_of(name);
    let text = utf8(archive.read(name)?);
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let shared = RefCell::new(archive);
    let (models, materials) = tobj::load_obj_buf(&mut Cursor::new(text), &options, |library| {
        let member = beside(name, &library.to_string_lossy());
        let bytes = shared
            .borrow_mut()
            .read(&member)
            .map_err(|_| tobj::LoadError::OpenFileFailed)?;
        tobj::load_mtl_buf(&mut Cursor::new(utf8(bytes)))
    })
    .map_err(|error| CadError::malformed(&path, "OBJ", error))?;
    let archive = shared.into_inner();
    let materials = materials.unwrap_or_else(|error| {
        tracing::warn!(
            "{}: its materials cannot be read ({error}); shown grey",
            path.display()
        );
        Vec::new()
    });

    let mut mesh = Mesh::default();
    for material in &materials {
        mesh.materials.push(Material {
            diffuse: material.diffuse.unwrap_or([0.8; 3]),
            opacity: material.dissolve.unwrap_or(1.0),
            texture: match &material.diffuse_texture {
                Some(file) => archive.texture(&beside(name, file_of(file)))?,
                None => None,
            },
        });
    }
    // A face may name a material that the library lacks (renamed by its exporter); where there is one, that is meant.
    let default_material = if materials.len() == 1 { 0 } else { materials.len() };
    mesh.materials.push(Material {
        diffuse: [0.8; 3],
        opacity: 1.0,
        texture: None,
    });
    for model in models {
        append(&mut mesh, &model.mesh, default_material);
    }
    Ok(mesh)
}

fn append(mesh: &mut Mesh, part: &tobj::Mesh, default_material: usize) {
    let base = mesh.vertices.len() as u32;
    mesh.vertices.extend(
        part.positions
            .chunks_exact(3)
            .map(|p| Vector3::new(p[0], p[1], p[2]).map(f64::from)),
    );
    let material = part.material_id.unwrap_or(default_material);
    for (i, corners) in part.indices.chunks_exact(3).enumerate() {
        let uv = |corner: usize| {
            part.texcoord_indices
                .get(3 * i + corner)
                .and_then(|&t| part.texcoords.get(2 * t as usize..2 * t as usize + 2))
                .map_or([0.0; 2], |uv| [uv[0], uv[1]])
        };
        mesh.triangles.push(Triangle {
            vertices: [corners[0], corners[1], corners[2]].map(|i| base + i),
            texture_coordinates: [uv(0), uv(1), uv(2)],
            material: material as u32,
        });
    }
}

/// The file in `map_Kd [-option value …] file`.
fn file_of(statement: &str) -> &str {
    if statement.starts_with('-') {
        statement.rsplit(' ').next().unwrap_or(statement)
    } else {
        statement
    }
}

/// Old exporters write Latin-1 in comments and names, which `tobj` refuses.
fn utf8(bytes: Vec<u8>) -> Vec<u8> {
    match String::from_utf8(bytes) {
        Ok(text) => text.into_bytes(),
        Err(error) => error
            .into_bytes()
            .iter()
            .map(|&b| char::from(b))
            .collect::<String>()
            .into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

    fn parse(obj: &str, mtl: &[u8]) -> Result<Mesh, CadError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.obj"), obj).unwrap();
        std::fs::write(folder.path().join("a.mtl"), mtl).unwrap();
        image::save_buffer(
            folder.path().join("t.png"),
            &[9, 8, 7],
            1,
            1,
            image::ColorType::Rgb8,
        )
        .unwrap();
        read(&mut Archive::open(folder.path()).unwrap(), "a.obj")
    }

    #[test]
    fn polygons_keep_colour_texture_and_coordinates() {
        let obj = format!("{SQUARE}usemtl b\nf 1/1 2/2 3/3 4/4\n");
        // The comment is Latin-1.
        let mtl = b"# \xe9\nnewmtl a\nKd 0 0 0\nnewmtl b\nKd 1 0.5 0.25\nd 0.5\nmap_Kd -s 1 1 1 t.png\n";
        let mesh = parse(&obj, mtl).unwrap();
        assert_eq!(mesh.triangles.len(), 2);
        let triangle = mesh.triangles[1];
        for (vertex, uv) in triangle.vertices.iter().zip(triangle.texture_coordinates) {
            let at = mesh.vertices[*vertex as usize];
            assert_eq!([at.x as f32, at.y as f32], uv);
        }
        let material = &mesh.materials[triangle.material as usize];
        assert_eq!((material.diffuse, material.opacity), ([1.0, 0.5, 0.25], 0.5));
        assert_eq!(material.texture.as_ref().unwrap().image[(0, 0)], [9.0, 8.0, 7.0]);
    }

    #[test]
    fn an_unknown_material_falls_back_to_the_only_one_or_to_grey() {
        let obj = format!("{SQUARE}usemtl lost\nf 1 2 3\n");
        let colour = |mtl: &[u8]| {
            let mesh = parse(&obj, mtl).unwrap();
            mesh.materials[mesh.triangles[0].material as usize].diffuse
        };
        assert_eq!(colour(b"newmtl a\nKd 1 0 0\n"), [1.0, 0.0, 0.0]);
        assert_eq!(colour(b"newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n"), [0.8; 3]);
    }

    #[test]
    fn a_face_without_its_vertex_is_an_error() {
        assert!(parse("v 0 0 0\nf 1 2 3\n", b"").is_err());
    }
}
