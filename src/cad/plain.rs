//! Files of one kind of axes under one folder or zip: plain folders, and the vehicles of two traffic simulators.

use super::archive::{Archive, stem};
use super::sources::{Library, NamedModel};
use super::{Axes, CadError, Mesh, ac3d, glb, obj};
use std::path::Path;

const EXTENSIONS: [&str; 4] = [".obj", ".glb", ".ac", ".acc"];

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
        files.retain(|name| is_model(name) && name.starts_with(folder));
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
        self.files.iter().map(|file| stem(file).to_owned()).collect()
    }

    fn load(&mut self, name: &str) -> Result<NamedModel, CadError> {
        let missing = || CadError::malformed(&self.archive.path_of(""), name, "no such model");
        let file = self
            .files
            .iter()
            .find(|file| stem(file) == name)
            .ok_or_else(missing)?;
        let mut mesh = read(&mut self.archive, file)?;
        mesh.turn(self.axes);
        Ok(NamedModel {
            name: name.to_owned(),
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

fn is_model(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    EXTENSIONS.iter().any(|extension| name.ends_with(extension))
}
