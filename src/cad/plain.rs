//! Files of one kind of axes under one folder or zip: plain folders, and the vehicles of two traffic simulators.

use super::archive::{Archive, distinct_names};
use super::sources::{Library, NamedModel};
use super::{Axes, CadError, Mesh, ac3d, glb, obj};
use std::path::Path;

const EXTENSIONS: [&str; 4] = [".obj", ".glb", ".ac", ".acc"];
/// The formats of other tools, which are not read here.
const OTHERS: [&str; 11] = [
    ".gltf", ".fbx", ".stl", ".ply", ".off", ".dae", ".3ds", ".blend", ".usdz", ".usd", ".x3d",
];

pub(super) struct Plain {
    archive: Archive,
    files: Vec<String>,
    source: String,
    licence: String,
    axes: Axes,
}

impl Plain {
    /// The files under `folder` (a prefix of their names, "" = all).
    pub(super) fn open(
        path: &Path,
        folder: &str,
        source: &str,
        licence: &str,
        axes: Axes,
    ) -> Result<Self, CadError> {
        let archive = Archive::open(path)?;
        let mut files = archive.names()?;
        files.retain(|name| name.starts_with(folder));
        let others = files.iter().filter(|name| has_ending(name, &OTHERS)).count();
        if others > 0 {
            tracing::warn!(
                "{}: {others} models are left out, as their formats ({}) are not read: convert them to OBJ or GLB",
                path.display(),
                OTHERS.join(", ")
            );
        }
        files.retain(|name| has_ending(name, &EXTENSIONS));
        let names = distinct_names(&files);
        if let Some((name, _)) = names.iter().zip(&files).find(|(name, file)| name == file) {
            tracing::warn!(
                "{}: {name} lies beside a file that differs in its extension alone; both are taken, exclude one if they are one model",
                path.display()
            );
        }
        Ok(Self {
            archive,
            files,
            source: source.to_owned(),
            licence: licence.to_owned(),
            axes,
        })
    }
}

impl Library for Plain {
    fn names(&self) -> Vec<String> {
        distinct_names(&self.files)
    }

    fn load(&mut self, index: usize) -> Result<NamedModel, CadError> {
        let mut mesh = read(&mut self.archive, &self.files[index])?;
        mesh.turn(self.axes);
        Ok(NamedModel {
            name: self.names().swap_remove(index),
            source: self.source.clone(),
            licence: self.licence.clone(),
            mesh,
            weight: 1.0,
        })
    }
}

/// One CAD file (AC3D, OBJ or GLB) in its own axes and units.
///
/// # Errors
/// The file cannot be read, is damaged, or is of another format.
pub fn load(path: &Path) -> Result<Mesh, CadError> {
    let unknown = || CadError::UnknownFormat(path.to_owned());
    let name = path
        .file_name()
        .and_then(|name| name.to_str())
        .ok_or_else(unknown)?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    read(&mut Archive::open(folder)?, name)
}

/// By content where the format has a mark, else by extension.
fn read(archive: &mut Archive, name: &str) -> Result<Mesh, CadError> {
    let bytes = archive.read(name)?;
    if bytes.starts_with(b"glTF") {
        glb::read(archive, name)
    } else if bytes.starts_with(b"AC3D") {
        ac3d::read(archive, name)
    } else if name.to_ascii_lowercase().ends_with(".obj") {
        obj::read(archive, name)
    } else {
        Err(CadError::UnknownFormat(archive.path_of(name)))
    }
}

fn has_ending(name: &str, endings: &[&str]) -> bool {
    let name = name.to_ascii_lowercase();
    endings.iter().any(|ending| name.ends_with(ending))
}
