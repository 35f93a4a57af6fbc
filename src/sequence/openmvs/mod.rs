//! openMVS: dense depth for a COLMAP workspace, or a project of its own.
//!
//! # Half a pixel
//! openMVS puts pixel centres at integers, COLMAP and we at +0.5. openMVS 2.3 subtracts 0.5 from COLMAP's principal
//! point on import; 2.1 takes COLMAP's numbers as they are, which tilts every one of its rays by half a pixel alike
//! and leaves z practically unchanged. Under both habits `depth[row][column]` was matched at the image's pixel
//! (column, row), so depth maps line up with images without a shift; what differs is what K means:
//!
//! | K's principal point | habit | ours |
//! |---|---|---|
//! | COLMAP's − 0.5 | 2.3 | + 0.5 |
//! | COLMAP's | 2.1 | as it is |
//!
//! Beside a COLMAP model the camera is COLMAP's, and the comparison only checks that both belong together. Alone, a
//! principal point at exactly half the image (COLMAP's default) tells 2.1, half a pixel less tells 2.3, else the
//! file version does: 7 came with 2.3.

mod attach;
pub(super) mod depth_map;
mod interface;

use super::distortion::Distortion;
use super::draft::{DenseDepth, Draft, FrameDraft, folder_name};
use super::error::SequenceError;
use super::workspace;
use crate::geometry::Pinhole;
use crate::image::natural_key;
use depth_map::OpenMvsDepth;
use interface::Interface;
use std::path::{Path, PathBuf};

pub(super) use attach::attach;

const SCENE: &str = "scene.mvs";
/// How openMVS was given its principal points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Habit {
    /// COLMAP's numbers (openMVS 2.1).
    Kept,
    /// COLMAP's numbers minus 0.5 (openMVS 2.3).
    Shifted,
}

struct Project {
    scene_file: PathBuf,
    interface: Interface,
    /// Sorted by file name.
    depth_maps: Vec<(PathBuf, OpenMvsDepth)>,
}

/// Whether `input` is an openMVS project.
pub(super) fn recognises(input: &Path) -> bool {
    input.join(SCENE).is_file()
}

/// An openMVS project alone: `scene.mvs`, `depth*.dmap`, `images/`, `masks/`, optional `times.txt`.
pub(super) fn draft(input: &Path) -> Result<Draft, SequenceError> {
    let images = workspace::need_folder(input, "images", "put the images that openMVS saw there")?;
    workspace::need_folder(
        input,
        "masks",
        "put one mask an image there, named <image>.png, white = object",
    )?;
    let mut project = read(input)?;
    let times = workspace::times(input)?;
    project
        .depth_maps
        .sort_by_cached_key(|(_, map)| natural_key(&map.image_name));
    let files: Vec<String> = project
        .depth_maps
        .iter()
        .map(|(_, map)| image_name_below(&images, &map.image_name))
        .collect();
    let names: Vec<&str> = files.iter().map(String::as_str).collect();
    let (mut notes, mut problems, mut frames) = (Vec::new(), Vec::new(), Vec::new());
    workspace::note_unused_images(input, &names, &mut notes);
    for (((file, map), image), name) in project
        .depth_maps
        .iter()
        .zip(&names)
        .zip(workspace::frame_names(&names))
    {
        let path = match workspace::image_file(input, image, file) {
            Ok(path) => path,
            Err(problem) => {
                problems.push(problem);
                continue;
            }
        };
        let shift = match alone(map, project.interface.version) {
            Habit::Kept => 0.0,
            Habit::Shifted => 0.5,
        };
        frames.push(FrameDraft {
            name,
            declared_in: file.clone(),
            image: path,
            mask: workspace::mask_file(input, image),
            camera: Pinhole {
                cx: map.camera.cx + shift,
                cy: map.camera.cy + shift,
                ..map.camera
            },
            distortion: Distortion::None,
            calibrated_size: Some(map.image_size),
            timestamp_s: workspace::time_of(&times, image),
            camera_from_input: Some(map.camera_from_world),
            depth: Some(DenseDepth::OpenMvsMap(file.clone())),
            points: Vec::new(),
            depth_deviation: None,
            truth: None,
        });
    }
    Ok(Draft {
        name: folder_name(input),
        kind: "openMVS project",
        motion_deviation: Some(workspace::MOTION_DEVIATION),
        focal_deviation: None,
        listing: project.scene_file,
        frames,
        truth_shape: None,
        notes,
        problems,
    })
}

/// Reads `scene.mvs` and every `depth*.dmap` beside it; their number must be that of the calibrated images.
fn read(folder: &Path) -> Result<Project, SequenceError> {
    let scene_file = folder.join(SCENE);
    let interface = interface::read(&scene_file)?;
    let entries = std::fs::read_dir(folder).map_err(|source| SequenceError::read(folder, source))?;
    let mut files: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|file| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("depth") && name.ends_with(".dmap")
        })
        .collect();
    files.sort();
    let mut depth_maps = Vec::with_capacity(files.len());
    for file in files {
        let map = depth_map::read(&file)?;
        if !interface.images.iter().any(|image| image.name == map.image_name) {
            return Err(SequenceError::invalid(
                &file,
                "image name",
                format!("`{}` is not in {SCENE}", map.image_name),
                "keep the depth maps of one project together",
            ));
        }
        depth_maps.push((file, map));
    }
    let calibrated = interface.images.iter().filter(|image| image.calibrated).count();
    if calibrated != depth_maps.len() {
        return Err(SequenceError::CountMismatch {
            file: scene_file,
            field: "calibrated images".into(),
            declared: calibrated as u64,
            found: depth_maps.len() as u64,
            mend: "one depth*.dmap an image must lie beside it; copy them all or run DensifyPointCloud again"
                .into(),
        });
    }
    Ok(Project {
        scene_file,
        interface,
        depth_maps,
    })
}

/// The habit where no COLMAP model tells.
fn alone(map: &OpenMvsDepth, version: u32) -> Habit {
    let (width, height) = (map.image_size.0 as f64, map.image_size.1 as f64);
    let at = |cx: f64, cy: f64| (map.camera.cx - cx).abs() < 1e-6 && (map.camera.cy - cy).abs() < 1e-6;
    if at(width / 2.0, height / 2.0) {
        Habit::Kept
    } else if at((width - 1.0) / 2.0, (height - 1.0) / 2.0) || version >= 7 {
        Habit::Shifted
    } else {
        Habit::Kept
    }
}

/// openMVS's path below `images/`: the longest tail that exists there, else the file name.
fn image_name_below(images: &Path, path: &str) -> String {
    let path = path.replace('\\', "/");
    let mut tail = path.as_str();
    loop {
        let shorter = tail.split_once('/').map(|(_, rest)| rest);
        match shorter {
            Some(rest) if tail.starts_with('/') || tail.contains("..") || !images.join(tail).is_file() => {
                tail = rest
            }
            _ => return tail.to_owned(),
        }
    }
}

/// Reads one file's bytes, for the targets in `fuzz/`.
#[cfg(fuzzing)]
pub(super) fn fuzz(name: &str, data: &[u8]) {
    let file = Path::new(name);
    let _ = match name {
        SCENE => interface::decode(data, file).map(drop),
        _ => depth_map::decode(data, file).map(drop),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_found_below_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("a")).unwrap();
        std::fs::write(folder.path().join("a/1.jpg"), "").unwrap();
        for path in [
            "a/1.jpg",
            "images/a/1.jpg",
            "/data/images/a/1.jpg",
            "../images/a/1.jpg",
        ] {
            assert_eq!(image_name_below(folder.path(), path), "a/1.jpg", "{path}");
        }
        assert_eq!(image_name_below(folder.path(), "images/2.jpg"), "2.jpg");
    }
}
