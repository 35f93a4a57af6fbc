//! Writes the result folder.

use super::colmap::ColmapModel;
use super::colour::{ColourGatherer, Colours};
use super::folder::Staging;
use super::sheet::Sheet;
use super::{FrameResult, ObjectiveSpan, ReportError, RunResult, SimilarityRecord, Surface};
use super::{density, depth, file_stems, overlay, ply, silhouette_iou, trace, trajectory};
use crate::geometry::{Pose, Similarity};
use crate::init::Estimate;
use crate::sequence::Sequence;
use crate::solver::Solution;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What goes into a result folder.
pub struct ReportInput<'a> {
    pub sequence: &'a Sequence,
    pub solution: &'a Solution,
    /// X(s), all N points: [`Surface::from_points`].
    pub surface: &'a Surface,
    /// The input as the user gave it.
    pub input: &'a str,
    /// The shape prior's name and version.
    pub prior: &'a str,
    /// The effective configuration, TOML.
    pub config: &'a str,
    /// [`peak_memory_mb`](super::peak_memory_mb) at the end of the solve.
    pub peak_memory_mb: Option<f64>,
}

/// What was written, and where.
#[derive(Clone, Debug)]
pub struct Written {
    pub folder: PathBuf,
    /// The first thing to look at.
    pub contact_sheet: PathBuf,
    pub result: RunResult,
}

/// Writes the result folder `out`: complete, or not at all. Refuses an `out` that exists and values that are not
/// finite.
pub fn write(input: &ReportInput, out: &Path) -> Result<Written, ReportError> {
    let (sequence, estimate) = (input.sequence, &input.solution.estimate);
    let poses = check(input)?;
    let object_from_input = object_from_input(sequence, estimate);
    let staging = Staging::beside(out)?;
    let (depth_folder, overlay_folder) = (staging.folder("depth")?, staging.folder("overlay")?);

    let stems = file_stems(sequence.frames.iter().map(|frame| frame.name.as_str()));
    let mut gatherer = ColourGatherer::new(input.surface.points.len());
    let mut colmap = ColmapModel::new(input.surface.points.len());
    let mut sheet = Sheet::new(poses.len());
    let mut frames = Vec::new();
    for (i, ((frame, pose), stem)) in sequence.frames.iter().zip(&poses).zip(&stems).enumerate() {
        let view = input.surface.render(&frame.camera, pose, frame.image.size());
        let silhouette = view.mask();
        frames.push(FrameResult::new(
            &frame.name,
            pose,
            silhouette_iou(&silhouette, &frame.mask),
            density(&frame.mask, &silhouette),
        ));
        gatherer.add(frame, pose, input.surface, &view);
        colmap.add(&frame.name, &frame.camera, pose, input.surface, &view);
        depth::write_depth(&depth_folder.join(format!("{stem}.exr")), &view.depth)?;
        let overlay = overlay::overlay(&frame.image, &view.depth, &frame.mask);
        save_png(&overlay_folder.join(format!("{stem}.png")), &overlay)?;
        sheet.add(i, &overlay::picture(&frame.image), &overlay);
    }
    save_png(&staging.path().join("overlay.png"), &sheet.draw())?;

    let colours = gatherer.finish(input.surface);
    write_shapes(&staging.path(), input.surface, &colours, object_from_input)?;
    colmap.write(&staging.folder("colmap")?, input.surface, &colours.rgb)?;
    let times: Vec<_> = sequence.frames.iter().map(|frame| frame.timestamp_s).collect();
    staging.text("cameras.txt", &trajectory::tum(&poses, &times))?;
    staging.text("trace.csv", &trace::csv(&input.solution.trace))?;
    staging.text("config.toml", input.config)?;
    let result = summarise(input, frames, object_from_input);
    staging.text("result.json", &result.to_json()?)?;
    staging.publish()?;
    Ok(Written {
        folder: out.to_owned(),
        contact_sheet: out.join("overlay.png"),
        result,
    })
}

/// The poses of all frames, once everything that is drawn is known to be finite.
fn check(input: &ReportInput) -> Result<Vec<Pose>, ReportError> {
    let (frames, estimate) = (&input.sequence.frames, &input.solution.estimate);
    if frames.len() != estimate.frame_count() {
        return Err(ReportError::FrameCount {
            frames: frames.len(),
            poses: estimate.frame_count(),
        });
    }
    if input.surface.points.is_empty() {
        return Err(ReportError::EmptyShape);
    }
    let shape = input.surface.points.iter().chain(&input.surface.normals);
    let values = shape.flatten().chain(&input.surface.radii);
    if !values.into_iter().all(|&value| (value as f32).is_finite()) {
        return Err(ReportError::NotFinite {
            field: "the shape".to_owned(),
        });
    }
    let scaled = frames.iter().any(|frame| frame.camera_from_input.is_some());
    if scaled && !(estimate.alpha > 0.0 && estimate.alpha.is_finite()) {
        return Err(ReportError::NoScale {
            alpha: estimate.alpha,
        });
    }
    let poses: Vec<_> = (0..frames.len())
        .map(|frame| estimate.camera_from_object(frame))
        .collect();
    for (frame, pose) in frames.iter().zip(&poses) {
        let finite = pose
            .rotation
            .matrix()
            .iter()
            .chain(&pose.translation)
            .all(|value| value.is_finite());
        if !finite {
            return Err(ReportError::NotFinite {
                field: format!("the pose of frame {}", frame.name),
            });
        }
    }
    Ok(poses)
}

/// From x_cam = α x'_cam (Eq. 10), x_cam = R x + t and x'_cam = R' x' + t' of the first frame with an input pose:
/// x = α Rᵀ R' x' + Rᵀ (α t' − t).
pub(super) fn object_from_input(sequence: &Sequence, estimate: &Estimate) -> Option<Similarity> {
    let (frame, input) = sequence
        .frames
        .iter()
        .enumerate()
        .find_map(|(i, frame)| Some((i, frame.camera_from_input?)))?;
    let object = estimate.camera_from_object(frame);
    let object_from_camera = object.rotation.inverse();
    Some(Similarity {
        scale: estimate.alpha,
        rotation: object_from_camera * input.rotation,
        translation: object_from_camera * (estimate.alpha * input.translation - object.translation),
    })
}

fn write_shapes(
    folder: &Path,
    surface: &Surface,
    colours: &Colours,
    object_from_input: Option<Similarity>,
) -> Result<(), ReportError> {
    let origin = format!(
        "colour: {} points seen in the frames, {} unseen ones like their mirror twin (x to -x), {} the mean colour",
        colours.seen,
        colours.mirrored,
        surface.points.len() - colours.seen - colours.mirrored,
    );
    let frame = "frame: object, +Y up, -Z front, bounding-box diagonal 1";
    ply::write_shape(
        &folder.join("shape.ply"),
        surface,
        &colours.rgb,
        &[frame.to_owned(), origin.clone()],
    )?;
    let Some(object_from_input) = object_from_input else {
        return Ok(());
    };
    let input_from_object = object_from_input.inverse();
    let in_input = Surface {
        points: surface
            .points
            .iter()
            .map(|point| input_from_object.transform(point))
            .collect(),
        normals: surface
            .normals
            .iter()
            .map(|normal| input_from_object.rotation * normal)
            .collect(),
        radii: surface
            .radii
            .iter()
            .map(|radius| input_from_object.scale * radius)
            .collect(),
    };
    ply::write_shape(
        &folder.join("shape_input.ply"),
        &in_input,
        &colours.rgb,
        &["frame: that of the input's poses, its units".to_owned(), origin],
    )
}

fn summarise(
    input: &ReportInput,
    frames: Vec<FrameResult>,
    object_from_input: Option<Similarity>,
) -> RunResult {
    let solution = input.solution;
    let mut seconds = BTreeMap::new();
    for (stage, spent) in &solution.seconds {
        *seconds.entry(stage.clone()).or_insert(0.0) += spent;
    }
    let scaled = |frame: &crate::sequence::Frame| frame.camera_from_input.is_some() || frame.depth.is_some();
    let mean = |value: fn(&FrameResult) -> f64| frames.iter().map(value).sum::<f64>() / frames.len() as f64;
    RunResult {
        schema: RunResult::schema(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        input: input.input.to_owned(),
        prior: input.prior.to_owned(),
        style: solution.estimate.style.clone(),
        alpha: input
            .sequence
            .frames
            .iter()
            .any(scaled)
            .then_some(solution.estimate.alpha),
        object_from_input: object_from_input.as_ref().map(SimilarityRecord::from),
        objective: ObjectiveSpan {
            start: solution.objective_start,
            end: solution.objective_end,
        },
        silhouette_iou_mean: mean(|frame| frame.silhouette_iou),
        density_mean: mean(|frame| frame.density),
        frames,
        evaluations: solution.evaluations,
        iterations: solution.iterations,
        termination: solution.termination,
        seconds,
        peak_memory_mb: input.peak_memory_mb,
        hypotheses: solution.hypotheses.clone(),
    }
}

fn save_png(path: &Path, picture: &image::RgbImage) -> Result<(), ReportError> {
    picture
        .save_with_format(path, image::ImageFormat::Png)
        .map_err(|error| ReportError::format(path, error))
}
