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

use super::distortion::Distortion;
use super::draft::{DenseDepth, Draft, FrameDraft, folder_name};
use super::error::SequenceError;
use super::validate::{check_camera_fits, check_pinhole};
use super::{openmvs, workspace};
use crate::geometry::Vector3;
use crate::image::natural_key;
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
    model.images.sort_by_cached_key(|image| natural_key(&image.name));
    check_unique(&model)?;
    check_cameras(&mut model, &mut problems);
    drop_points_nowhere(&mut model, &mut notes);
    let names: Vec<&str> = model.images.iter().map(|image| image.name.as_str()).collect();
    workspace::note_unused_images(input, &names, &mut notes);
    let mut frames = frames(input, &model, &names, depth.is_none(), &mut problems)?;
    match depth {
        Some(folder) => openmvs::attach(&mut frames, &images, folder, &mut notes, &mut problems)?,
        None => note_depth(input, &frames, &mut notes),
    }
    problems.extend(check_proportion(&frames, &model.images_file));
    Ok(Draft {
        name: folder_name(input),
        kind: "COLMAP workspace",
        motion_deviation: Some(workspace::MOTION_DEVIATION),
        focal_deviation: None,
        listing: model.images_file,
        frames,
        truth_shape: None,
        notes,
        problems,
    })
}

/// What is wrong with the cameras.
fn check_cameras(model: &mut Model, problems: &mut Vec<SequenceError>) {
    for (id, camera) in &mut model.cameras {
        let (file, field) = (&model.cameras_file, format!("camera {id}"));
        let mut faults = check_pinhole(&camera.pinhole, file, &field);
        if faults.is_empty() {
            faults.extend(check_camera_fits(&camera.pinhole, camera.size, file, &field).err());
        }
        if let Err(fault) = camera.distortion.check(file, &field) {
            faults.push(fault);
            // Told once, here, and not again of every frame.
            camera.distortion = Distortion::None;
        }
        problems.append(&mut faults);
    }
}

fn drop_points_nowhere(model: &mut Model, notes: &mut Vec<String>) {
    let all = model.points.len();
    model
        .points
        .retain(|point| point.position.iter().all(|value| value.is_finite()));
    if model.points.len() < all {
        let left_out = all - model.points.len();
        notes.push(format!(
            "{left_out} points whose position is not finite are left out"
        ));
    }
}

/// The frames of all images that have a camera and a file; what the others lack goes to `problems`. COLMAP's own dense depth goes with them where
/// `own_depth` says so.
fn frames(
    input: &Path,
    model: &Model,
    names: &[&str],
    own_depth: bool,
    problems: &mut Vec<SequenceError>,
) -> Result<Vec<FrameDraft>, SequenceError> {
    let times = workspace::times(input)?;
    let mut observed = observed_points(model);
    let mut frames = Vec::with_capacity(model.images.len());
    for (image, name) in model.images.iter().zip(workspace::frame_names(names)) {
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
            depth: (own_depth && dense.is_file()).then_some(DenseDepth::ColmapMap(dense)),
            points: sparse,
            depth_deviation: None,
            truth: None,
        });
    }
    Ok(frames)
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

/// Says what depth there is not.
fn note_depth(input: &Path, frames: &[FrameDraft], notes: &mut Vec<String>) {
    let without = |frame: &&FrameDraft| frame.depth.is_none() && frame.points.is_empty();
    let none = frames.iter().filter(without).count();
    if none > 0 {
        notes.push(format!("{none} frames have no depth at all"));
    }
    let maps = std::fs::read_dir(input.join("stereo/depth_maps"));
    let names: Vec<String> = maps
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    let any = |ending: &str| names.iter().any(|name| name.ends_with(ending));
    if any(".photometric.bin") && !any(".geometric.bin") {
        notes.push(
            "stereo/depth_maps holds no geometric depth maps; photometric ones are left out, as they are full of outliers \
             (run patch_match_stereo with geom_consistency)"
                .into(),
        );
    }
}

/// Cameras that stand a thousand times farther from the others than those do among themselves: structure from motion went astray.
fn check_proportion(frames: &[FrameDraft], listing: &Path) -> Vec<SequenceError> {
    const OUT_OF_PROPORTION: f64 = 1e3;
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let centers: Vec<Vector3<f64>> = frames
        .iter()
        .filter_map(|frame| Some(frame.camera_from_input?.center()))
        .collect();
    let middle = Vector3::from_fn(|axis, _| median(centers.iter().map(|center| center[axis]).collect()));
    let usual = median(centers.iter().map(|center| (center - middle).norm()).collect());
    frames
        .iter()
        .filter_map(|frame| {
            let away = (frame.camera_from_input?.center() - middle).norm();
            // Cameras at one place have no proportion.
            (usual > 0.0 && away > OUT_OF_PROPORTION * usual).then(|| {
                SequenceError::invalid(
                    listing,
                    format!("image of frame `{}`", frame.name),
                    format!(
                        "its camera is {:.0} times farther away than the others are",
                        away / usual
                    ),
                    "take the image out of the model, or run SfM again",
                )
            })
        })
        .collect()
}

/// Reads one file's bytes, for the targets in `fuzz/`.
#[cfg(fuzzing)]
pub(super) fn fuzz(name: &str, data: &[u8]) {
    let file = Path::new(name);
    let text = crate::files::decode_text(data.to_vec()).unwrap_or_default();
    let _ = match name {
        "cameras.txt" => text::cameras(&text, file).map(drop),
        "images.txt" => text::images(&text, file).map(drop),
        "points3D.txt" => text::points(&text, file).map(drop),
        "cameras.bin" => binary::cameras(data, file).map(drop),
        "images.bin" => binary::images(data, file).map(drop),
        "points3D.bin" => binary::points(data, file).map(drop),
        _ => depth_map::decode(data, file).map(drop),
    };
}
