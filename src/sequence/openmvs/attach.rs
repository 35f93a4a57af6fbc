//! Dense depth for a COLMAP workspace: finds each frame's depth map and checks that it belongs to COLMAP's camera.

use super::depth_map::OpenMvsDepth;
use super::{Habit, read};
use crate::geometry::Pose;
use crate::sequence::SequenceError;
use crate::sequence::distortion::Distortion;
use crate::sequence::draft::{DenseDepth, FrameDraft};
use std::collections::BTreeSet;
use std::path::Path;

/// How far openMVS's numbers may be from COLMAP's: it halves and normalises K on the way.
const PIXEL_TOLERANCE: f64 = 0.05;
const FOCAL_TOLERANCE: f64 = 1e-3;
const ANGLE_TOLERANCE_RAD: f64 = 1e-3;
const CENTER_TOLERANCE: f64 = 1e-3;

/// Gives COLMAP's frames the depth maps in `folder`.
pub(in crate::sequence) fn attach(
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
                frame.depth = Some(DenseDepth::OpenMvsMap(file.clone()));
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

/// Whether openMVS's path names COLMAP's image: equal, or ending in it after a slash.
fn names_image(path: &str, image: &str) -> bool {
    let path = path.replace('\\', "/");
    path.strip_suffix(image)
        .is_some_and(|rest| rest.is_empty() || rest.ends_with('/'))
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
}
