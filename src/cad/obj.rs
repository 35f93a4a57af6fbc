//! Wavefront OBJ with MTL: `v`, `vt`, `f`, `usemtl`, `mtllib`; `newmtl`, `Kd`, `d`, `map_Kd`. All else is passed over.

use super::archive::{Archive, beside};
use super::lines::Lines;
use super::{CadError, Material, Mesh, Triangle};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const GREY: [f32; 3] = [0.8; 3];

/// Reads the member `name` of `archive`; materials and textures are looked for beside it.
pub(super) fn read(archive: &mut Archive, name: &str) -> Result<Mesh, CadError> {
    let path = archive.path_of(name);
    let bytes = utf8(archive.read(name)?);
    let mut reader = Reader {
        lines: Lines::new(&bytes, &path),
        positions: Vec::new(),
        texture_coordinates: Vec::new(),
        faces: Vec::new(),
        material: None,
        libraries: Vec::new(),
    };
    reader.file()?;
    let Reader {
        positions,
        texture_coordinates,
        faces,
        libraries,
        ..
    } = reader;

    let mut materials = Vec::new();
    for library in libraries {
        match read_library(archive, &beside(name, &library)) {
            Ok(read) => materials.extend(read),
            // Exporters leave them behind; a shape needs none.
            Err(error) => tracing::warn!("{error}; the materials of {} are shown grey", path.display()),
        }
    }
    let mut mesh = Mesh {
        vertices: positions,
        ..Mesh::default()
    };
    for material in &materials {
        mesh.materials.push(Material {
            diffuse: material.diffuse.unwrap_or(GREY),
            opacity: material.opacity.unwrap_or(1.0),
            texture: match &material.texture {
                Some(file) => archive.texture(&beside(name, file_of(file)))?,
                None => None,
            },
        });
    }
    // A face may name a material that the library lacks (renamed by its exporter); where there is one, that is meant.
    let default_material = if materials.len() == 1 { 0 } else { materials.len() };
    mesh.materials.push(Material {
        diffuse: GREY,
        opacity: 1.0,
        texture: None,
    });
    let coordinates = |corner: Corner| {
        corner
            .texture
            .map_or([0.0; 2], |index| texture_coordinates[index])
    };
    let numbers: BTreeMap<&str, usize> = materials.iter().map(|m| m.name.as_str()).zip(0..).collect();
    for face in faces {
        let named = face.material.and_then(|name| numbers.get(&*name).copied());
        mesh.triangles.push(Triangle {
            vertices: face.corners.map(|corner| corner.vertex as u32),
            texture_coordinates: face.corners.map(coordinates),
            material: named.unwrap_or(default_material) as u32,
        });
    }
    Ok(mesh)
}

/// Indices into what was read so far.
#[derive(Clone, Copy)]
struct Corner {
    vertex: usize,
    texture: Option<usize>,
}

/// A triangle, and the material that was in use.
struct Face {
    corners: [Corner; 3],
    material: Option<Arc<str>>,
}

struct Reader<'a> {
    lines: Lines<'a>,
    positions: Vec<Vector3<f64>>,
    texture_coordinates: Vec<[f32; 2]>,
    faces: Vec<Face>,
    material: Option<Arc<str>>,
    libraries: Vec<String>,
}

impl Reader<'_> {
    fn file(&mut self) -> Result<(), CadError> {
        while let Some(mut line) = self.lines.next() {
            while line.ends_with('\\') {
                line.pop();
                line += &self.lines.next().unwrap_or_default();
            }
            let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
            let words: Vec<&str> = rest.split_whitespace().collect();
            match keyword {
                "v" => {
                    // As exact as most readers have them, so that a model is the same to all.
                    let position: Vec<f32> = self.lines.numbers(&words, 3)?;
                    self.positions
                        .push(Vector3::new(position[0], position[1], position[2]).map(f64::from));
                }
                "vt" => {
                    let both: Vec<f32> = self.lines.numbers(&words, words.len().clamp(1, 2))?;
                    self.texture_coordinates
                        .push([both[0], both.get(1).copied().unwrap_or(0.0)]);
                }
                "f" => self.face(&words)?,
                "usemtl" => self.material = Some(rest.trim().into()),
                "mtllib" => self.libraries.push(rest.trim().to_owned()),
                _ => {}
            }
        }
        Ok(())
    }

    /// A polygon as a fan; points and lines are none.
    fn face(&mut self, words: &[&str]) -> Result<(), CadError> {
        let corners: Vec<Corner> = words
            .iter()
            .map(|word| self.corner(word))
            .collect::<Result<_, _>>()?;
        for i in 2..corners.len() {
            self.faces.push(Face {
                corners: [corners[0], corners[i - 1], corners[i]],
                material: self.material.clone(),
            });
        }
        Ok(())
    }

    /// `vertex`, `vertex/texture`, `vertex/texture/normal` or `vertex//normal`.
    fn corner(&self, word: &str) -> Result<Corner, CadError> {
        let mut parts = word.split('/');
        let vertex = self.index(parts.next().unwrap_or_default(), self.positions.len(), "vertex")?;
        let texture = match parts.next() {
            None | Some("") => None,
            Some(part) => Some(self.index(part, self.texture_coordinates.len(), "texture coordinate")?),
        };
        Ok(Corner { vertex, texture })
    }

    /// From 1, or from −1 backwards.
    fn index(&self, word: &str, count: usize, what: &str) -> Result<usize, CadError> {
        let number: Option<i64> = word.parse().ok();
        let index = match number {
            None | Some(0) => None,
            Some(number) if number > 0 => usize::try_from(number - 1).ok(),
            Some(number) => usize::try_from(number.unsigned_abs())
                .ok()
                .and_then(|back| count.checked_sub(back)),
        };
        index
            .filter(|&index| index < count)
            .ok_or_else(|| self.lines.error(format!("{what} '{word}' of {count}")))
    }
}

/// What an MTL says of a material.
struct LibraryMaterial {
    name: String,
    diffuse: Option<[f32; 3]>,
    opacity: Option<f32>,
    texture: Option<String>,
}

fn read_library(archive: &mut Archive, name: &str) -> Result<Vec<LibraryMaterial>, CadError> {
    let path = archive.path_of(name);
    parse_library(&utf8(archive.read(name)?), &path)
}

fn parse_library(bytes: &[u8], path: &Path) -> Result<Vec<LibraryMaterial>, CadError> {
    let mut lines = Lines::new(bytes, path);
    let mut materials: Vec<LibraryMaterial> = Vec::new();
    while let Some(line) = lines.next() {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        let (rest, words) = (rest.trim(), rest.split_whitespace().collect::<Vec<_>>());
        if keyword == "newmtl" {
            materials.push(LibraryMaterial {
                name: rest.to_owned(),
                diffuse: None,
                opacity: None,
                texture: None,
            });
        }
        let Some(material) = materials.last_mut() else {
            continue;
        };
        match keyword {
            "Kd" => {
                // Green and blue may be left out, and are then as red.
                let given: Vec<f32> = lines.numbers(&words, words.len().clamp(1, 3))?;
                let channel = |at: usize| given.get(at).unwrap_or(&given[0]).clamp(0.0, 1.0);
                material.diffuse = Some([channel(0), channel(1), channel(2)]);
            }
            "d" => material.opacity = Some(lines.numbers::<f32>(&words, 1)?[0].clamp(0.0, 1.0)),
            "map_Kd" => material.texture = Some(rest.to_owned()),
            _ => {}
        }
    }
    Ok(materials)
}

/// The file in `map_Kd [-option value …] file`.
fn file_of(statement: &str) -> &str {
    if statement.starts_with('-') {
        statement.rsplit(' ').next().unwrap_or(statement)
    } else {
        statement
    }
}

/// Old exporters write Latin-1 in comments and names.
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
    fn colours_may_be_grey_or_nonsense() {
        let obj = format!("{SQUARE}usemtl a\nf 1 2 3\n");
        for (kd, expected) in [
            ("Kd 0", [0.0; 3]),
            ("Kd 0.5", [0.5; 3]),
            ("Kd 255 0 0", [1.0, 0.0, 0.0]),
            // A warning tells of these.
            ("Kd", GREY),
            ("Kd nan 0 0", GREY),
            ("Kd spectral file.rfl 1", GREY),
        ] {
            let mesh = parse(&obj, format!("newmtl a\n{kd}\n").as_bytes()).unwrap();
            assert_eq!(
                mesh.materials[mesh.triangles[0].material as usize].diffuse, expected,
                "{kd}"
            );
        }
        let problem = parse_library(b"newmtl a\n\nKd x\n", Path::new("a.mtl"))
            .err()
            .unwrap();
        assert_eq!(problem.to_string(), "a.mtl: line 3: expected 1 finite numbers");
    }

    #[test]
    fn what_cannot_be_is_named_with_its_line() {
        for (obj, words) in [
            ("v 0 0 0\nf 1 2 3\n", "line 2: vertex '2' of 1"),
            ("v 0 0 0\nf 0 0 0\n", "line 2: vertex '0' of 1"),
            ("v 0 0 0\nf -2 -1 -1\n", "line 2: vertex '-2' of 1"),
            ("v 0 0 0\nf 1/1 1/1 1/1\n", "line 2: texture coordinate '1' of 0"),
            ("v 0 0 0\nv nan nan nan\n", "line 2: expected 3 finite numbers"),
            ("v 0 0\n", "line 1: expected 3 finite numbers"),
            ("v 0 0 1e40\n", "line 1: expected 3 finite numbers"),
        ] {
            let message = parse(obj, b"").unwrap_err().to_string();
            assert!(
                message.contains("a.obj: ") && message.contains(words),
                "{message}"
            );
        }
    }

    #[test]
    fn marks_continued_lines_and_backward_indices_are_read() {
        let obj = "\u{feff}v 0 0 0\nv 1 0 0\r\nv 0 \\\n1 0\nl 1 2\nf -3//1 -2//1 -1//1\n";
        let mesh = parse(obj, b"").unwrap();
        assert_eq!(mesh.vertices[2], Vector3::new(0.0, 1.0, 0.0));
        assert_eq!(mesh.triangles.len(), 1);
        assert_eq!(mesh.triangles[0].vertices, [0, 1, 2]);
    }
}
