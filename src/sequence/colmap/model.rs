//! A COLMAP reconstruction in memory, from `sparse/` in either format.

use super::camera::Camera;
use super::{binary, text};
use crate::files::read_text;
use crate::geometry::{Pose, Rotation3, UnitQuaternion, Vector3};
use crate::image::natural_key;
use crate::sequence::SequenceError;
use crate::sequence::validate::check_translation;
use nalgebra::Quaternion;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Cameras, registered images and points.
pub(super) struct Model {
    pub cameras: BTreeMap<u32, Camera>,
    pub images: Vec<Image>,
    /// Empty where the workspace has no `points3D`.
    pub points: Vec<Point>,
    pub cameras_file: PathBuf,
    pub images_file: PathBuf,
}

/// One registered image.
pub(super) struct Image {
    pub id: u32,
    /// Relative to `images/`.
    pub name: String,
    pub camera: u32,
    pub camera_from_world: Pose,
}

/// One reconstructed point.
pub(super) struct Point {
    /// World frame.
    pub position: Vector3<f64>,
    /// Ids of the images that observe it.
    pub images: Vec<u32>,
}

/// Reads `sparse/`, or the model below it with most images; where both formats lie side by side, the binary one, as COLMAP does.
pub(super) fn read(workspace: &Path, notes: &mut Vec<String>) -> Result<Model, SequenceError> {
    let sparse = workspace.join("sparse");
    let below = models_below(&sparse);
    if has_model(&sparse) {
        if !below.is_empty() {
            notes.push(format!(
                "sparse/ itself is read; it also holds {}, left out",
                named(&below)
            ));
        }
        return read_folder(&sparse);
    }
    if below.len() < 2 {
        let folder = below.into_iter().next().ok_or_else(|| SequenceError::Missing {
            file: sparse,
            what: "cameras and images (.txt or .bin)".into(),
            mend: "export COLMAP's model into sparse/ or sparse/0/".into(),
        })?;
        return read_folder(&folder);
    }
    // COLMAP numbers them as it comes upon them; the first need not be the largest.
    let mut best: Option<(PathBuf, Model)> = None;
    let mut counts = Vec::new();
    for folder in &below {
        let model = read_folder(folder)?;
        counts.push(model.images.len().to_string());
        if best
            .as_ref()
            .is_none_or(|(_, best)| model.images.len() > best.images.len())
        {
            best = Some((folder.clone(), model));
        }
    }
    let (folder, model) = best.ok_or_else(|| SequenceError::NotRecognised(workspace.to_owned()))?;
    notes.push(format!(
        "sparse/ holds several models ({}) of {} images; {} is read, as it has most",
        named(&below),
        counts.join(", "),
        named(&[folder])
    ));
    Ok(model)
}

/// The folders in `sparse` with a model, numbers in their names by value.
fn models_below(sparse: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(sparse).into_iter().flatten().flatten();
    let mut below: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| has_model(path))
        .collect();
    below.sort_by_cached_key(|folder| natural_key(&folder.to_string_lossy()));
    below
}

fn named(folders: &[PathBuf]) -> String {
    let name = |folder: &PathBuf| {
        format!(
            "sparse/{}",
            folder.file_name().unwrap_or_default().to_string_lossy()
        )
    };
    folders.iter().map(name).collect::<Vec<_>>().join(", ")
}

fn read_folder(folder: &Path) -> Result<Model, SequenceError> {
    let is_binary = folder.join("images.bin").is_file();
    let path = |name: &str| {
        folder
            .join(name)
            .with_extension(if is_binary { "bin" } else { "txt" })
    };
    let (cameras_file, images_file, points_file) = (path("cameras"), path("images"), path("points3D"));
    let (cameras, images, points);
    if is_binary {
        cameras = binary::cameras(&bytes_of(&cameras_file)?, &cameras_file)?;
        images = binary::images(&bytes_of(&images_file)?, &images_file)?;
        points = read_points(&points_file, |file| binary::points(&bytes_of(file)?, file))?;
    } else {
        cameras = text::cameras(&text_of(&cameras_file)?, &cameras_file)?;
        images = text::images(&text_of(&images_file)?, &images_file)?;
        points = read_points(&points_file, |file| text::points(&text_of(file)?, file))?;
    }
    Ok(Model {
        cameras,
        images,
        points,
        cameras_file,
        images_file,
    })
}

/// The points are optional.
fn read_points(
    file: &Path,
    read: impl Fn(&Path) -> Result<Vec<Point>, SequenceError>,
) -> Result<Vec<Point>, SequenceError> {
    if file.is_file() {
        read(file)
    } else {
        Ok(Vec::new())
    }
}

fn bytes_of(file: &Path) -> Result<Vec<u8>, SequenceError> {
    std::fs::read(file).map_err(|source| SequenceError::read(file, source))
}

fn text_of(file: &Path) -> Result<String, SequenceError> {
    read_text(file).map_err(|error| SequenceError::read(file, error))
}

/// Whether a folder holds COLMAP's image list.
pub(super) fn has_model(folder: &Path) -> bool {
    ["images.bin", "images.txt"]
        .iter()
        .any(|name| folder.join(name).is_file())
}

/// A pose from COLMAP's quaternion (w first) and translation; `place` names the entry in the error.
pub(super) fn pose(
    quaternion: [f64; 4],
    translation: [f64; 3],
    file: &Path,
    place: &str,
) -> Result<Pose, SequenceError> {
    let [w, x, y, z] = quaternion;
    let quaternion = Quaternion::new(w, x, y, z);
    // NaN lies in no range.
    if !(0.999..1.001).contains(&quaternion.norm()) {
        return Err(SequenceError::invalid(
            file,
            place,
            format!(
                "pose is no rigid motion (quaternion of length {:.3})",
                quaternion.norm()
            ),
            "export the model again",
        ));
    }
    let translation = Vector3::from(translation);
    check_translation(&translation, file, place)?;
    let rotation: Rotation3<f64> = UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix();
    Ok(Pose {
        rotation,
        translation,
    })
}
