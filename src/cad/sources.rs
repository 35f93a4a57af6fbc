//! Named models out of freely licensed packages, in the canonical frame: what priors are learned from and what is
//! rendered.

use super::archive::Archive;
use super::plain::Plain;
use super::sweethome::SweetHome;
use super::torcs::Torcs;
use super::trigger::Trigger;
use super::{Axes, Axis, CadError, Mesh};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A model in the object frame: +Y up, −Z front, as [`Mesh::normalise`] leaves it.
#[derive(Clone, Debug)]
pub struct NamedModel {
    /// Once only within its source.
    pub name: String,
    /// The package that it comes from.
    pub source: String,
    /// SPDX where the package gives it so, else the package's own words.
    pub licence: String,
    /// The model's triangles and materials.
    pub mesh: Mesh,
    /// How much it counts in what is learned.
    pub weight: f64,
}

/// Where models come from; in TOML, `kind = "torcs"`, `path = "…"`, ….
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SourceSpec {
    /// Which reader reads the source.
    pub kind: SourceKind,
    /// What each [`SourceKind`] says.
    pub path: PathBuf,
    /// Names to keep, `*` standing for any run of characters; empty = all. Each must match something.
    #[serde(default)]
    pub include: Vec<String>,
    /// Names to leave out, likewise.
    #[serde(default)]
    pub exclude: Vec<String>,
    /// Sweet Home 3D only: the catalogue's category to keep.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub category: Option<String>,
    /// Plain folders only: which axis of the files points up and to the front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Axis>,
    /// Plain folders only: which axis of the files points to the object's front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<Axis>,
    /// Plain folders only: the licence of the files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// Plain folders only: where the files are from; else the folder's name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub package: Option<String>,
    /// How much each model counts in what is learned; 1 unless given.
    #[serde(default = "full", skip_serializing_if = "is_full")]
    pub weight: f64,
}

fn full() -> f64 {
    1.0
}

fn is_full(weight: &f64) -> bool {
    *weight == full()
}

/// How a package keeps its models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SourceKind {
    /// TORCS's data folder, with `cars/` and `wheels/` (Debian: `torcs-data`).
    Torcs,
    /// An `.sh3f` library, or a folder of them (Debian: `sweethome3d-furniture`).
    Sweethome3d,
    /// Trigger Rally's `data.zip` (Debian: `trigger-rally-data`).
    Trigger,
    /// The `.whl` of `sumo-data` (PyPI), or the folder that it unpacks to.
    Sumo,
    /// The `.whl` of `smarts` (PyPI), likewise.
    Smarts,
    /// A folder (or zip) of OBJ, GLB and AC3D files with common axes.
    Plain,
}

/// A package opened: its models by name.
pub(super) trait Library {
    /// In the order in which they are to be loaded, each once.
    fn names(&self) -> Vec<String>;

    /// The model of that place among the names, in the canonical axes, not yet normalised.
    fn load(&mut self, index: usize) -> Result<NamedModel, CadError>;
}

/// Loads the models of a source that `include` and `exclude` leave, normalised, sorted by name within each library.
///
/// # Errors
/// A file that cannot be read, a pattern that matches nothing, an option that the kind does not have.
pub fn load_source(source: &SourceSpec) -> Result<Vec<NamedModel>, CadError> {
    source.check()?;
    let mut libraries = source.open()?;
    let names: Vec<Vec<String>> = libraries.iter().map(|library| library.names()).collect();
    for pattern in source.include.iter().chain(&source.exclude) {
        if !names.iter().flatten().any(|name| matches(pattern, name)) {
            let known = names
                .iter()
                .flatten()
                .map(String::as_str)
                .collect::<Vec<_>>()
                .join(", ");
            let problem = format!("'{pattern}' matches none of its models: {known}");
            return Err(CadError::source(&source.path, problem));
        }
    }
    let mut models = Vec::new();
    for (library, names) in libraries.iter_mut().zip(&names) {
        for (index, name) in names.iter().enumerate().filter(|(_, name)| source.selects(name)) {
            let mut model = library.load(index)?;
            if model.mesh.triangles.is_empty() {
                return Err(CadError::source(
                    &source.path,
                    format!("{name} has no triangles; exclude it"),
                ));
            }
            model.mesh.check().map_err(|problem| {
                CadError::source(&source.path, format!("{name}: {problem}; mend or exclude it"))
            })?;
            model.mesh.normalise();
            model.weight = source.weight;
            models.push(model);
        }
    }
    if models.is_empty() {
        return Err(CadError::source(
            &source.path,
            "no models; check path, kind and category",
        ));
    }
    Ok(models)
}

/// Reads every model of a source, for the targets in `fuzz/`: what comes after takes a thousand times as long.
#[cfg(fuzzing)]
pub fn fuzz(source: &SourceSpec) {
    for library in &mut source.open().unwrap_or_default() {
        for index in 0..library.names().len() {
            let _ = library.load(index).map(|model| model.mesh.check());
        }
    }
}

impl SourceSpec {
    fn check(&self) -> Result<(), CadError> {
        let wrong = |problem: &str| Err(CadError::source(&self.path, problem));
        if self.category.is_some() && self.kind != SourceKind::Sweethome3d {
            return wrong("category belongs to kind sweethome3d; use include");
        }
        let of_plain = [
            self.up.is_some(),
            self.front.is_some(),
            self.licence.is_some(),
            self.package.is_some(),
        ];
        if of_plain.contains(&true) && self.kind != SourceKind::Plain {
            return wrong("up, front, licence and package belong to kind plain; leave them out");
        }
        if !(self.weight > 0.0 && self.weight <= 1.0) {
            return wrong("weight must be above 0 and at most 1");
        }
        Ok(())
    }

    fn open(&self) -> Result<Vec<Box<dyn Library>>, CadError> {
        let path = &self.path;
        let single = |library: Box<dyn Library>| vec![library];
        Ok(match self.kind {
            SourceKind::Torcs => single(Box::new(Torcs::open(path)?)),
            SourceKind::Sweethome3d => libraries_in(path)?
                .iter()
                .map(|path| {
                    let library = SweetHome::open(path, self.category.as_deref())?;
                    Ok(Box::new(library) as Box<dyn Library>)
                })
                .collect::<Result<_, CadError>>()?,
            SourceKind::Trigger => single(Box::new(Trigger::open(path)?)),
            SourceKind::Sumo => single(Box::new(Plain::open(
                path,
                "sumo_data/data/3D/car-",
                "sumo-data",
                "EPL-2.0 OR GPL-2.0-or-later",
                Axes::Y_UP_Z_FRONT,
            )?)),
            SourceKind::Smarts => single(Box::new(Plain::open(
                path,
                "smarts/assets/vehicles/visual_model/",
                "smarts",
                "MIT",
                Axes::CANONICAL,
            )?)),
            SourceKind::Plain => {
                let (Some(up), Some(front), Some(licence)) = (self.up, self.front, &self.licence) else {
                    return Err(CadError::source(path, "kind plain needs up, front and licence"));
                };
                let axes = Axes::new(up, front)
                    .ok_or_else(|| CadError::source(path, "up and front lie along one axis; give two"))?;
                let folder = path.file_name().unwrap_or_default().to_string_lossy();
                let package = self.package.as_deref().unwrap_or(&folder);
                single(Box::new(Plain::open(path, "", package, licence, axes)?))
            }
        })
    }

    fn selects(&self, name: &str) -> bool {
        let any = |patterns: &[String]| patterns.iter().any(|pattern| matches(pattern, name));
        (self.include.is_empty() || any(&self.include)) && !any(&self.exclude)
    }
}

/// The `.sh3f` files of a folder, sorted; a file stands for itself.
fn libraries_in(path: &Path) -> Result<Vec<PathBuf>, CadError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let names = Archive::open(path)?.names()?;
    Ok(names
        .iter()
        .filter(|name| name.ends_with(".sh3f"))
        .map(|name| path.join(name))
        .collect())
}

/// Whether `name` fits `pattern`, in which `*` stands for any run of characters.
pub fn matches(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((head, tail)) => name.strip_prefix(head).is_some_and(|rest| {
            let ends = rest.char_indices().map(|(i, _)| i).chain([rest.len()]);
            ends.map(|i| &rest[i..]).any(|rest| matches(tail, rest))
        }),
    }
}

#[cfg(test)]
#[path = "sources_tests.rs"]
mod tests;
