//! A COLMAP reconstruction in memory, from `sparse/` in either format.

use super::camera::Camera;
use super::{binary, text};
use crate::geometry::{Pose, Rotation3, UnitQuaternion, Vector3};
use crate::sequence::SequenceError;
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

/// Reads `sparse/` or `sparse/0/`; where both formats lie side by side, the binary one, as COLMAP does.
pub(super) fn read(workspace: &Path, notes: &mut Vec<String>) -> Result<Model, SequenceError> {
    let sparse = workspace.join("sparse");
    let folder = [sparse.clone(), sparse.join("0")]
        .into_iter()
        .find(|folder| has_model(folder))
        .ok_or_else(|| SequenceError::Missing {
            file: sparse.clone(),
            what: "cameras and images (.txt or .bin)".into(),
            mend: "export COLMAP's model into sparse/ or sparse/0/".into(),
        })?;
    if sparse.join("1").is_dir() && folder == sparse.join("0") {
        notes.push("sparse/ holds several models; sparse/0 is read".into());
    }
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
    std::fs::read_to_string(file).map_err(|source| SequenceError::read(file, source))
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
    let finite = translation.iter().all(|value| value.is_finite());
    // Written so that NaN fails.
    if !((quaternion.norm() - 1.0).abs() < 1e-3 && finite) {
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
    let rotation: Rotation3<f64> = UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix();
    Ok(Pose {
        rotation,
        translation: Vector3::from(translation),
    })
}
