//! COLMAP workspaces: `images/`, `sparse/` (text or binary), `masks/<image>.png`, optional
//! `stereo/depth_maps/<image>.geometric.bin` or openMVS's depth, optional `times.txt`.
//!
//! Poses are `camera_from_world`; the world is the input frame. Pixel centres are at +0.5, as ours. Where there is
//! no dense depth, the points that a frame observes serve as semi-dense depth.

mod binary;
mod camera;
pub(super) mod depth_map;
mod model;
mod text;

use super::draft::{DepthSource, Draft, FrameDraft, folder_name};
use super::error::SequenceError;
use super::validate::check_pinhole;
use super::{openmvs, workspace};
use crate::geometry::Vector3;
use model::{Image, Model};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Whether `input` looks like a COLMAP workspace.
pub(super) fn recognises(input: &Path) -> bool {
    let sparse = input.join("sparse");
    sparse.is_dir()
        && (input.join("images").is_dir() || model::has_model(&sparse) || sparse.join("0").is_dir())
}

pub(super) fn draft(input: &Path, depth: Option<&Path>) -> Result<Draft, SequenceError> {
    let images = workspace::need_folder(input, "images", "put the images that COLMAP saw there")?;
    workspace::need_folder(
        input,
        "masks",
        "put one mask an image there, named <image>.png, white = object",
    )?;
    let mut notes = Vec::new();
    let mut problems = Vec::new();
    let mut model = model::read(input, &mut notes)?;
    model.images.sort_by(|a, b| a.name.cmp(&b.name));
    check_unique(&model)?;
    for (id, camera) in &model.cameras {
        problems.extend(check_pinhole(
            &camera.pinhole,
            &model.cameras_file,
            &format!("camera {id}"),
        ));
    }

    let times = workspace::times(input)?;
    let names: Vec<&str> = model.images.iter().map(|image| image.name.as_str()).collect();
    workspace::note_unused_images(input, &names, &mut notes);
    let mut observed = observed_points(&model);
    let mut frames = Vec::with_capacity(model.images.len());
    for (image, name) in model.images.iter().zip(workspace::frame_names(&names)) {
        let Some(camera) = model.cameras.get(&image.camera) else {
            problems.push(SequenceError::invalid(
                &model.images_file,
                format!("image `{}`", image.name),
                format!(
                    "its camera {} is not in {}",
                    image.camera,
                    model.cameras_file.display()
                ),
                "export both files from one model",
            ));
            continue;
        };
        let file = match workspace::image_file(input, &image.name, &model.images_file) {
            Ok(file) => file,
            Err(problem) => {
                problems.push(problem);
                continue;
            }
        };
        let dense = input.join(format!("stereo/depth_maps/{}.geometric.bin", image.name));
        let sparse = observed.remove(&image.id).unwrap_or_default();
        frames.push(FrameDraft {
            name,
            declared_in: model.cameras_file.clone(),
            image: file,
            mask: workspace::mask_file(input, &image.name),
            camera: camera.pinhole,
            distortion: camera.distortion,
            calibrated_size: Some(camera.size),
            timestamp_s: workspace::time_of(&times, &image.name),
            camera_from_input: Some(image.camera_from_world),
            depth: match (depth, dense.is_file(), sparse.is_empty()) {
                (Some(_), _, _) | (None, false, true) => DepthSource::None,
                (None, true, _) => DepthSource::ColmapMap(dense),
                (None, false, false) => DepthSource::Points(sparse),
            },
            depth_deviation: None,
            truth: None,
        });
    }
    match depth {
        Some(folder) => openmvs::attach(&mut frames, &images, folder, &mut notes, &mut problems)?,
        None => note_depth(&frames, &mut notes),
    }
    Ok(Draft {
        name: folder_name(input),
        kind: "COLMAP workspace",
        motion_deviation: None,
        focal_deviation: None,
        listing: model.images_file,
        frames,
        truth_shape: None,
        notes,
        problems,
    })
}

fn check_unique(model: &Model) -> Result<(), SequenceError> {
    let (mut names, mut ids) = (BTreeSet::new(), BTreeSet::new());
    for Image { name, id, .. } in &model.images {
        if !(names.insert(name) && ids.insert(id)) {
            return Err(SequenceError::invalid(
                &model.images_file,
                format!("image {id} `{name}`"),
                "its id or name occurs twice",
                "export the model again",
            ));
        }
    }
    Ok(())
}

/// The points that each image (by id) observes, in its camera frame.
fn observed_points(model: &Model) -> BTreeMap<u32, Vec<Vector3<f64>>> {
    let poses: BTreeMap<_, _> = model
        .images
        .iter()
        .map(|image| (image.id, image.camera_from_world))
        .collect();
    let mut observed: BTreeMap<u32, Vec<_>> = BTreeMap::new();
    for point in &model.points {
        for id in &point.images {
            if let Some(pose) = poses.get(id) {
                observed
                    .entry(*id)
                    .or_default()
                    .push(pose.transform(&point.position));
            }
        }
    }
    observed
}

fn note_depth(frames: &[FrameDraft], notes: &mut Vec<String>) {
    let count = |wanted: fn(&DepthSource) -> bool| frames.iter().filter(|frame| wanted(&frame.depth)).count();
    let sparse = count(|depth| matches!(depth, DepthSource::Points(_)));
    let none = count(|depth| matches!(depth, DepthSource::None));
    if sparse > 0 {
        notes.push(format!(
            "{sparse} frames have no dense depth; the sparse points that each observes serve as semi-dense depth"
        ));
    }
    if none > 0 {
        notes.push(format!("{none} frames have no depth at all"));
    }
}
