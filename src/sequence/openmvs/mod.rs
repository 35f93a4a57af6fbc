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

pub(super) mod depth_map;
mod scene;

use super::distortion::Distortion;
use super::draft::{DepthSource, Draft, FrameDraft, folder_name};
use super::error::SequenceError;
use super::workspace;
use crate::geometry::{Pinhole, Pose};
use depth_map::OpenMvsDepth;
use scene::Scene;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const SCENE: &str = "scene.mvs";
/// How far openMVS's numbers may be from COLMAP's: it halves and normalises K on the way.
const PIXEL_TOLERANCE: f64 = 0.05;
const FOCAL_TOLERANCE: f64 = 1e-3;
const ANGLE_TOLERANCE_RAD: f64 = 1e-3;
const CENTER_TOLERANCE: f64 = 1e-3;

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
    scene: Scene,
    /// Sorted by file name.
    depth_maps: Vec<(PathBuf, OpenMvsDepth)>,
}

/// Whether `input` is an openMVS project.
pub(super) fn recognises(input: &Path) -> bool {
    input.join(SCENE).is_file()
}

/// Gives COLMAP's frames the depth maps in `folder`.
pub(super) fn attach(
    frames: &mut [FrameDraft],
    images: &Path,
    folder: &Path,
    notes: &mut Vec<String>,
    problems: &mut Vec<SequenceError>,
) -> Result<(), SequenceError> {
    let project = read(folder)?;
    let mut habits = BTreeSet::new();
    let mut used = vec![false; project.depth_maps.len()];
    let mut without = 0;
    for frame in frames {
        let name = frame
            .image
            .strip_prefix(images)
            .unwrap_or(&frame.image)
            .to_string_lossy();
        let found = project
            .depth_maps
            .iter()
            .position(|(_, map)| names_image(&map.image_name, &name));
        let (Some(index), Some(pose)) = (found, &frame.camera_from_input) else {
            without += 1;
            continue;
        };
        let (file, map) = &project.depth_maps[index];
        used[index] = true;
        match check_camera(file, map, frame, pose) {
            Ok(habit) => {
                habits.insert(habit);
                frame.depth = DepthSource::OpenMvsMap(file.clone());
            }
            Err(problem) => problems.push(problem),
        }
    }
    for ((file, map), _) in project.depth_maps.iter().zip(used).filter(|(_, used)| !used) {
        problems.push(SequenceError::invalid(
            file,
            "image name",
            format!("`{}` is not registered in sparse/", map.image_name),
            "give the openMVS project that was made from this COLMAP model",
        ));
    }
    if habits.len() > 1 {
        problems.push(SequenceError::invalid(
            &project.scene_file,
            "K",
            "some principal points are COLMAP's and some are 0.5 less",
            "run InterfaceCOLMAP and DensifyPointCloud again, with one version",
        ));
    }
    if without > 0 {
        notes.push(format!(
            "{without} frames have no depth map in {}",
            folder.display()
        ));
    }
    for habit in habits {
        notes.push(match habit {
            Habit::Kept => {
                "openMVS kept COLMAP's principal point (2.1's habit); depth lines up pixel by pixel".into()
            }
            Habit::Shifted => {
                "openMVS shifted COLMAP's principal point by -0.5 (2.3's habit); depth lines up pixel by \
                               pixel"
                    .into()
            }
        });
    }
    Ok(())
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
        .sort_by(|(_, a), (_, b)| a.image_name.cmp(&b.image_name));
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
        let shift = match alone(map, project.scene.version) {
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
            depth: DepthSource::OpenMvsMap(file.clone()),
            truth: None,
        });
    }
    Ok(Draft {
        name: folder_name(input),
        kind: "openMVS project",
        listing: project.scene_file,
        frames,
        truth_shape: None,
        notes,
        problems,
    })
}

/// Reads the scene and every `depth*.dmap` beside it; their number must be that of the calibrated images.
fn read(folder: &Path) -> Result<Project, SequenceError> {
    let scene_file = folder.join(SCENE);
    let scene = scene::read(&scene_file)?;
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
        if !scene.images.iter().any(|image| image.name == map.image_name) {
            return Err(SequenceError::invalid(
                &file,
                "image name",
                format!("`{}` is not in {SCENE}", map.image_name),
                "keep the depth maps of one project together",
            ));
        }
        depth_maps.push((file, map));
    }
    let calibrated = scene.images.iter().filter(|image| image.calibrated).count();
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
        scene,
        depth_maps,
    })
}

/// Checks that a depth map belongs to COLMAP's camera and pose, and tells the habit.
fn check_camera(
    file: &Path,
    map: &OpenMvsDepth,
    frame: &FrameDraft,
    pose: &Pose,
) -> Result<Habit, SequenceError> {
    let another = |field: &str, problem: String| {
        SequenceError::invalid(
            file,
            field,
            problem,
            "give the COLMAP model that this openMVS project was made from (undistorted, by image_undistorter)",
        )
    };
    if frame.distortion != Distortion::None {
        return Err(another(
            "K",
            "COLMAP's camera has distortion, openMVS's never has".into(),
        ));
    }
    if frame.calibrated_size.is_some_and(|size| size != map.image_size) {
        return Err(SequenceError::Size {
            file: file.to_owned(),
            what: "image".into(),
            found: map.image_size,
            expected: frame.calibrated_size.unwrap_or_default(),
            mend: "run DensifyPointCloud on the images that lie in images/".into(),
        });
    }
    let (ours, theirs) = (&frame.camera, &map.camera);
    for (name, ours, theirs) in [("fx", ours.fx, theirs.fx), ("fy", ours.fy, theirs.fy)] {
        if (ours - theirs).abs() > FOCAL_TOLERANCE * ours.abs() {
            return Err(another("K", format!("{name} is {theirs:.2}, COLMAP's {ours:.2}")));
        }
    }
    let (dx, dy) = (theirs.cx - ours.cx, theirs.cy - ours.cy);
    let near = |shift: f64| (dx - shift).abs() < PIXEL_TOLERANCE && (dy - shift).abs() < PIXEL_TOLERANCE;
    let habit = if near(0.0) {
        Habit::Kept
    } else if near(-0.5) {
        Habit::Shifted
    } else {
        let problem =
            format!("principal point differs from COLMAP's by ({dx:.2}, {dy:.2}), neither 0 nor -0.5");
        return Err(another("K", problem));
    };
    let turn = pose.rotation.rotation_to(&map.camera_from_world.rotation).angle();
    let (center, center_there) = (pose.center(), map.camera_from_world.center());
    let apart = (center - center_there).norm();
    if turn > ANGLE_TOLERANCE_RAD || apart > CENTER_TOLERANCE * (1.0 + center.norm()) {
        let problem = format!(
            "pose differs from COLMAP's by {:.2}° and {apart:.3} units",
            turn.to_degrees()
        );
        return Err(another("R, C", problem));
    }
    Ok(habit)
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

/// Whether openMVS's path names COLMAP's image: equal, or ending in it after a slash.
fn names_image(path: &str, image: &str) -> bool {
    let path = path.replace('\\', "/");
    path.strip_suffix(image)
        .is_some_and(|rest| rest.is_empty() || rest.ends_with('/'))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_name_images_at_folder_borders_only() {
        assert!(names_image("images/a/1.jpg", "a/1.jpg"));
        assert!(names_image("1.jpg", "1.jpg"));
        assert!(names_image("C:\\shots\\1.jpg", "1.jpg"));
        assert!(!names_image("images/11.jpg", "1.jpg"));
        assert!(!names_image("images/1.jpg", "a/1.jpg"));
    }

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
