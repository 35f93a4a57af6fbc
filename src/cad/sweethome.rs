//! Furniture libraries of Sweet Home 3D (`.sh3f`): a zip of OBJ models and a catalogue of them.
//!
//! Catalogue: Java properties, `key#n=value` for the n-th model. A model is turned by `modelRotation` (3 × 3,
//! row-major), then stretched to `width` × `height` × `depth` centimetres along x, y, z; y is up, +z the front.

use super::archive::Archive;
use super::sources::{Library, NamedModel};
use super::{Axes, CadError, Mesh, obj};
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const CATALOGUES: [&str; 2] = [
    "PluginFurnitureCatalog.properties",
    // The models that the program itself brings, in `sweethome3d.jar`.
    "com/eteks/sweethome3d/io/DefaultFurnitureCatalog.properties",
];

/// A library, of which one category is wanted, or all.
pub(super) struct SweetHome {
    archive: Archive,
    catalogue: Catalogue,
}

impl SweetHome {
    pub(super) fn open(path: &Path, category: Option<&str>) -> Result<Self, CadError> {
        let mut archive = Archive::open(path)?;
        let mut catalogue = catalogue(&mut archive)?;
        if let Some(category) = category {
            catalogue.models.retain(|entry| entry.category == category);
        }
        catalogue.models.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self { archive, catalogue })
    }
}

impl Library for SweetHome {
    fn names(&self) -> Vec<String> {
        self.catalogue
            .models
            .iter()
            .map(|entry| entry.name.clone())
            .collect()
    }

    fn load(&mut self, index: usize) -> Result<NamedModel, CadError> {
        let entry = &self.catalogue.models[index];
        Ok(NamedModel {
            name: entry.name.clone(),
            source: format!("Sweet Home 3D, {}", self.catalogue.name),
            licence: entry
                .licence
                .clone()
                .unwrap_or_else(|| self.catalogue.licence.clone()),
            mesh: model(&mut self.archive, entry)?,
            weight: 1.0,
        })
    }
}

/// What the catalogue says of a library.
struct Catalogue {
    name: String,
    licence: String,
    models: Vec<Entry>,
}

/// What the catalogue says of a model.
struct Entry {
    /// The part of the id after '#', which the library uses once only.
    name: String,
    category: String,
    licence: Option<String>,
    model: String,
    rotation: Matrix3<f64>,
    /// x, y, z in centimetres.
    size: Vector3<f64>,
}

fn catalogue(archive: &mut Archive) -> Result<Catalogue, CadError> {
    for name in CATALOGUES {
        if let Some(bytes) = archive.read_if_present(name)? {
            // Java properties are Latin-1.
            let text: String = bytes.into_iter().map(char::from).collect();
            let path = archive.path_of(name);
            return parse(&text).map_err(|(place, problem)| CadError::malformed(&path, place, problem));
        }
    }
    Err(CadError::source(
        &archive.path_of(""),
        format!("no {}; give an .sh3f library", CATALOGUES[0]),
    ))
}

/// The model in the canonical axes, not yet normalised.
fn model(archive: &mut Archive, entry: &Entry) -> Result<Mesh, CadError> {
    let mut mesh = obj::read(archive, &entry.model)?;
    mesh.map(&entry.rotation);
    if let Some((low, high)) = mesh.bounds() {
        let extent = (high - low).sup(&Vector3::repeat(f64::MIN_POSITIVE));
        mesh.map(&Matrix3::from_diagonal(&entry.size.component_div(&extent)));
    }
    mesh.turn(Axes::Y_UP_Z_FRONT);
    Ok(mesh)
}

/// (key, problem) where an entry is damaged.
fn parse(text: &str) -> Result<Catalogue, (String, String)> {
    let mut library: BTreeMap<&str, &str> = BTreeMap::new();
    let mut numbered: BTreeMap<u32, BTreeMap<&str, &str>> = BTreeMap::new();
    for line in text.lines().map(str::trim).filter(|line| !line.starts_with('#')) {
        let Some((key, value)) = line.split_once('=') else {
            continue;
        };
        match key.split_once('#') {
            Some((key, number)) => {
                let number = number
                    .parse()
                    .map_err(|_| (key.to_owned(), format!("'#{number}' is not a number")))?;
                numbered.entry(number).or_default().insert(key, value.trim());
            }
            None => {
                library.insert(key, value.trim());
            }
        }
    }
    let of_library = |key: &str| library.get(key).copied().unwrap_or_default().to_owned();
    let models = numbered
        .iter()
        .map(|(number, values)| entry(*number, values))
        .collect::<Result<Vec<_>, _>>()?;
    let mut names = BTreeSet::new();
    match models.iter().find(|model| !names.insert(&model.name)) {
        Some(model) => Err(("id".to_owned(), format!("'{}' is two models' name", model.name))),
        None => Ok(Catalogue {
            name: of_library("name"),
            licence: of_library("license"),
            models,
        }),
    }
}

fn entry(number: u32, values: &BTreeMap<&str, &str>) -> Result<Entry, (String, String)> {
    let text = |key: &str| {
        values
            .get(key)
            .copied()
            .ok_or_else(|| (format!("{key}#{number}"), "missing".to_owned()))
    };
    let numbers = |key: &str, count: usize| -> Result<Vec<f64>, (String, String)> {
        let parsed: Option<Vec<f64>> = text(key)?.split_whitespace().map(|w| w.parse().ok()).collect();
        parsed
            .filter(|values| values.len() == count && values.iter().all(|v| v.is_finite()))
            .ok_or_else(|| (format!("{key}#{number}"), format!("expected {count} numbers")))
    };
    let id = text("id")?;
    Ok(Entry {
        name: id.rsplit('#').next().unwrap_or(id).to_owned(),
        category: values.get("category").copied().unwrap_or_default().to_owned(),
        licence: values.get("license").map(|&licence| licence.to_owned()),
        model: text("model")?.trim_start_matches('/').to_owned(),
        rotation: match values.get("modelRotation") {
            Some(_) => Matrix3::from_row_slice(&numbers("modelRotation", 9)?),
            None => Matrix3::identity(),
        },
        size: Vector3::new(
            numbers("width", 1)?[0],
            numbers("height", 1)?[0],
            numbers("depth", 1)?[0],
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CATALOGUE: &str = "# c\nname=Lib\nlicense=CC0\nid#2=Lib#a-car\ncategory#2=Vehicles\nmodel#2=/m/a.obj\n\
        width#2=10\ndepth#2=40\nheight#2=20\nmodelRotation#2=0 -1 0 1 0 0 0 0 1\n";

    #[test]
    fn the_model_is_turned_stretched_and_brought_to_the_canonical_axes() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(CATALOGUES[0]), CATALOGUE).unwrap();
        std::fs::create_dir(folder.path().join("m")).unwrap();
        // x right, y up and z front of the file's box are told apart by the vertices.
        std::fs::write(
            folder.path().join("m/a.obj"),
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n",
        )
        .unwrap();
        let mut archive = Archive::open(folder.path()).unwrap();
        let catalogue = catalogue(&mut archive).unwrap();
        assert_eq!(
            (catalogue.name.as_str(), catalogue.licence.as_str()),
            ("Lib", "CC0")
        );
        assert_eq!(catalogue.models[0].name, "a-car");
        let mesh = model(&mut archive, &catalogue.models[0]).unwrap();
        // modelRotation takes x to y and y to −x; then width along x, height along y, depth along z; front +z → −z.
        let relative: Vec<Vector3<f64>> = mesh.vertices.iter().map(|v| v - mesh.vertices[0]).collect();
        assert!((relative[1] - Vector3::new(0.0, 20.0, 0.0)).norm() < 1e-9);
        assert!((relative[2] - Vector3::new(10.0, 0.0, 0.0)).norm() < 1e-9);
        assert!((relative[3] - Vector3::new(0.0, 0.0, -40.0)).norm() < 1e-9);
    }

    #[test]
    fn damage_names_the_key() {
        let bad = CATALOGUE.replace("width#2=10", "width#2=ten");
        assert_eq!(parse(&bad).err().unwrap().0, "width#2");
        let missing = CATALOGUE.replace("model#2", "icon#2");
        assert_eq!(parse(&missing).err().unwrap().0, "model#2");
        let twice = format!("{CATALOGUE}{}", CATALOGUE.replace("#2", "#3"));
        let (_, problem) = parse(&twice).err().unwrap();
        assert_eq!(problem, "'a-car' is two models' name");
    }
}
