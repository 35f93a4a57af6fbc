//! AC3D (`.ac`) and TORCS's dialect of it (`.acc`): triangle strips, vertices with normals, several textures.
//!
//! ```text
//! AC3Db
//! MATERIAL "name" rgb R G B … trans T
//! OBJECT world|group|poly|light
//!   name|url "…"   data N (N bytes follow)   texture "file" [base|tiled|skids|shad]   texrep u v   texoff u v
//!   rot 9 numbers   loc x y z   crease a   numvert N (N lines x y z …)   numsurf N
//!     SURF flags   mat i   refs N (N lines: index u v …)
//!   kids N (N objects follow)
//! ```

use super::archive::{Archive, beside};
use super::lines::Lines;
use super::{CadError, Material, Mesh, Triangle};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::collections::BTreeMap;

/// Reads the member `name` of `archive`; textures are looked for beside it. Vertices stay in the file's frame.
pub(super) fn read(archive: &mut Archive, name: &str) -> Result<Mesh, CadError> {
    let bytes = archive.read(name)?;
    let path = archive.path_of(name);
    let mut reader = Reader {
        lines: Lines::new(&bytes, &path),
        archive,
        name,
        materials: Vec::new(),
        used: BTreeMap::new(),
        mesh: Mesh::default(),
    };
    reader.file()?;
    Ok(reader.mesh)
}

struct Reader<'a> {
    lines: Lines<'a>,
    archive: &'a mut Archive,
    name: &'a str,
    /// The file's own, in order.
    materials: Vec<Material>,
    /// (file's material, texture) → the mesh's material.
    used: BTreeMap<(usize, Option<String>), u32>,
    mesh: Mesh,
}

/// `x_parent = rotation x_child + translation`, composed down to the file's frame.
#[derive(Clone, Copy)]
struct Placement {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

/// What an `OBJECT` has said of itself so far.
struct Object {
    is_light: bool,
    placement: Placement,
    texture: Option<String>,
    repeat: Vector2<f32>,
    offset: Vector2<f32>,
    first_vertex: usize,
    vertex_count: usize,
}

impl Reader<'_> {
    fn file(&mut self) -> Result<(), CadError> {
        let header = self.lines.next().unwrap_or_default();
        if !header.starts_with("AC3D") {
            return Err(self.lines.error("the first line must start with AC3D"));
        }
        while let Some(line) = self.lines.next() {
            let words = split_quoted(&line);
            match words.first().map(String::as_str) {
                Some("MATERIAL") => {
                    let material = self.material(&words)?;
                    self.materials.push(material);
                }
                Some("OBJECT") => self.object(
                    &words,
                    Placement {
                        rotation: Matrix3::identity(),
                        translation: Vector3::zeros(),
                    },
                    0,
                )?,
                _ => {}
            }
        }
        Ok(())
    }

    fn material(&self, words: &[String]) -> Result<Material, CadError> {
        let after = |key: &str, count: usize| -> Result<Vec<f32>, CadError> {
            let at = words.iter().position(|w| w == key);
            at.and_then(|at| words.get(at + 1..at + 1 + count))
                .and_then(|values| values.iter().map(|w| w.parse().ok()).collect())
                .ok_or_else(|| {
                    self.lines
                        .error(format!("MATERIAL needs {count} numbers after {key}"))
                })
        };
        let rgb = after("rgb", 3)?;
        Ok(Material {
            diffuse: [rgb[0], rgb[1], rgb[2]],
            opacity: 1.0 - after("trans", 1)?[0],
            texture: None,
        })
    }

    fn object(&mut self, words: &[String], parent: Placement, depth: usize) -> Result<(), CadError> {
        // A bound on the recursion, so that a hostile file cannot exhaust the stack.
        if depth > 64 {
            return Err(self.lines.error("objects nest deeper than 64"));
        }
        let mut object = Object {
            is_light: words.get(1).is_some_and(|w| w == "light"),
            placement: parent,
            texture: None,
            repeat: Vector2::new(1.0, 1.0),
            offset: Vector2::zeros(),
            first_vertex: self.mesh.vertices.len(),
            vertex_count: 0,
        };
        while let Some(line) = self.lines.next() {
            let words = split_quoted(&line);
            match words.first().map(String::as_str) {
                Some("data") => {
                    let length = self.lines.numbers::<usize>(&words[1..], 1)?[0];
                    self.lines.skip_bytes(length)?;
                }
                Some("texture") => {
                    let layer = words.get(2).map_or("base", String::as_str);
                    if let (Some(file), "base") = (words.get(1), layer) {
                        object.texture =
                            (!file.is_empty() && file != "empty_texture_no_mapping").then(|| file.clone());
                    }
                }
                Some("texrep") => object.repeat = Vector2::from_vec(self.lines.numbers(&words[1..], 2)?),
                Some("texoff") => object.offset = Vector2::from_vec(self.lines.numbers(&words[1..], 2)?),
                Some("loc") => {
                    let at = Vector3::from_vec(self.lines.numbers(&words[1..], 3)?);
                    object.placement.translation += parent.rotation * at;
                }
                Some("rot") => {
                    // AC3D multiplies row vectors from the left, so the nine numbers are the transpose.
                    let rows: Vec<f64> = self.lines.numbers(&words[1..], 9)?;
                    object.placement.rotation = parent.rotation * Matrix3::from_column_slice(&rows);
                }
                Some("numvert") => self.vertices(&words, &mut object)?,
                Some("SURF") => self.surface(&words, &object)?,
                Some("kids") => {
                    let kids = self.lines.numbers::<usize>(&words[1..], 1)?[0];
                    for _ in 0..kids {
                        // Some files of FlightGear announce more than they have.
                        let Some(line) = self.lines.next() else {
                            tracing::warn!(
                                "{}",
                                self.lines.error("the file ends before the last of the kids")
                            );
                            return Ok(());
                        };
                        let words = split_quoted(&line);
                        if words.first().is_none_or(|w| w != "OBJECT") {
                            return Err(self.lines.error("fewer OBJECT blocks than kids announces"));
                        }
                        self.object(&words, object.placement, depth + 1)?;
                    }
                    return Ok(());
                }
                _ => {}
            }
        }
        Err(self.lines.error("the file ends inside an OBJECT (no kids line)"))
    }

    fn vertices(&mut self, words: &[String], object: &mut Object) -> Result<(), CadError> {
        object.vertex_count = self.lines.numbers::<usize>(&words[1..], 1)?[0];
        for _ in 0..object.vertex_count {
            let line = self.lines.next().unwrap_or_default();
            let words: Vec<&str> = line.split_whitespace().collect();
            let xyz = Vector3::from_vec(self.lines.numbers(&words, 3)?);
            let Placement {
                rotation,
                translation,
            } = object.placement;
            self.mesh.vertices.push(rotation * xyz + translation);
        }
        Ok(())
    }

    fn surface(&mut self, words: &[String], object: &Object) -> Result<(), CadError> {
        let flags = words
            .get(1)
            .and_then(|w| {
                let digits = w.strip_prefix("0x").or_else(|| w.strip_prefix("0X"));
                u32::from_str_radix(digits.unwrap_or(w), 16).ok()
            })
            .ok_or_else(|| self.lines.error("SURF needs hexadecimal flags"))?;
        let mut material = 0;
        loop {
            let line = self
                .lines
                .next()
                .ok_or_else(|| self.lines.error("the file ends inside a SURF"))?;
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.first() {
                Some(&"mat") => material = self.lines.numbers::<usize>(&words[1..], 1)?[0],
                Some(&"refs") => {
                    let count = self.lines.numbers::<usize>(&words[1..], 1)?[0];
                    let corners = self.corners(count, object)?;
                    if object.is_light {
                        return Ok(());
                    }
                    return self.triangulate(flags & 15, &corners, material, object);
                }
                _ => return Err(self.lines.error("expected mat or refs inside a SURF")),
            }
        }
    }

    /// (index into the mesh's vertices, texture coordinates) of each corner.
    fn corners(&mut self, count: usize, object: &Object) -> Result<Vec<(u32, [f32; 2])>, CadError> {
        let mut corners = Vec::new();
        for _ in 0..count {
            let line = self.lines.next().unwrap_or_default();
            let words: Vec<&str> = line.split_whitespace().collect();
            let index: usize = self.lines.numbers(&words, 1)?[0];
            if index >= object.vertex_count {
                return Err(self.lines.error(format!(
                    "refs vertex {index} of an object of {}",
                    object.vertex_count
                )));
            }
            let uv: Vec<f32> = match words.len() {
                1 | 2 => vec![0.0, 0.0],
                _ => self.lines.numbers(&words[1..], 2)?,
            };
            let uv = Vector2::from_vec(uv).component_mul(&object.repeat) + object.offset;
            corners.push(((object.first_vertex + index) as u32, uv.into()));
        }
        Ok(corners)
    }

    fn triangulate(
        &mut self,
        kind: u32,
        corners: &[(u32, [f32; 2])],
        material: usize,
        object: &Object,
    ) -> Result<(), CadError> {
        let triples: Vec<[usize; 3]> = match kind {
            0 => (2..corners.len()).map(|i| [0, i - 1, i]).collect(),
            4 => (2..corners.len())
                .map(|i| {
                    if i % 2 == 0 {
                        [i - 2, i - 1, i]
                    } else {
                        [i - 1, i - 2, i]
                    }
                })
                .collect(),
            1 | 2 => return Ok(()),
            other => {
                return Err(self
                    .lines
                    .error(format!("surface type {other}; known are 0, 1, 2 and 4")));
            }
        };
        let material = self.mesh_material(material, object.texture.as_deref())?;
        for triple in triples {
            let vertices = triple.map(|i| corners[i].0);
            // Strips are stitched with triangles that have a corner twice.
            if vertices[0] != vertices[1] && vertices[1] != vertices[2] && vertices[2] != vertices[0] {
                self.mesh.triangles.push(Triangle {
                    vertices,
                    texture_coordinates: triple.map(|i| corners[i].1),
                    material,
                });
            }
        }
        Ok(())
    }

    fn mesh_material(&mut self, index: usize, texture: Option<&str>) -> Result<u32, CadError> {
        let key = (index, texture.map(str::to_owned));
        if let Some(&known) = self.used.get(&key) {
            return Ok(known);
        }
        let mut material = self.materials.get(index).cloned().ok_or_else(|| {
            self.lines
                .error(format!("mat {index} of {} MATERIAL lines", self.materials.len()))
        })?;
        if let Some(file) = texture {
            material.texture = self.archive.texture(&beside(self.name, file))?;
        }
        let number = self.mesh.materials.len() as u32;
        self.mesh.materials.push(material);
        self.used.insert(key, number);
        Ok(number)
    }
}

/// Words split at white space, except inside double quotes, which are dropped.
fn split_quoted(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (i, part) in line.split('"').enumerate() {
        if i % 2 == 1 {
            words.push(part.to_owned());
        } else {
            words.extend(part.split_whitespace().map(str::to_owned));
        }
    }
    words
}

#[cfg(test)]
#[path = "ac3d_tests.rs"]
mod tests;
