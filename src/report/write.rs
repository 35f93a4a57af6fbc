//! Writes the result folder.

use super::colmap::ColmapModel;
use super::colour::{ColourGatherer, Colours};
use super::exposure::gains;
use super::folder::Staging;
use super::page::{PAGE, write_page};
use super::ply::Vertices;
use super::sheet::Sheet;
use super::texture::{Texture, TextureGatherer};
use super::{Doubts, FrameResult, ObjectiveSpan, ReportError, RunResult, SimilarityRecord, Surface};
use super::{density, file_stems, glb, overlay, ply, silhouette_iou, trace, trajectory};
use crate::files::write_whole;
use crate::geometry::{OBJECT_FRAME, Pose, Similarity};
use crate::image::{write_depth, write_mask};
use crate::sequence::Sequence;
use crate::solver::Solution;
use crate::surface::median;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What goes into a result folder.
pub struct ReportInput<'a> {
    /// The sequence that was solved.
    pub sequence: &'a Sequence,
    /// What the solve found.
    pub solution: &'a Solution,
    /// The shape found: [`Surface::of`].
    pub surface: &'a Surface,
    /// The input as the user gave it.
    pub input: &'a str,
    /// The shape prior's name and version.
    pub prior: &'a str,
    /// The object's real length from front to back, metres, where it is known.
    pub length_m: Option<f64>,
    /// Names of the frames whose masks were decided anew; these are written as well.
    pub masks_anew: &'a [String],
    /// The effective configuration, TOML.
    pub config: &'a str,
    /// The standard deviation of the focal lengths' logarithm that the solve was given; 0 where they were held.
    pub focal_deviation: f64,
    /// [`peak_memory_mb`](super::peak_memory_mb) at the end of the solve.
    pub peak_memory_mb: Option<f64>,
}

/// What was written, and where.
#[derive(Clone, Debug)]
pub struct Written {
    /// The result folder.
    pub folder: PathBuf,
    /// The first thing to look at, in a browser.
    pub page: PathBuf,
    /// All frames with the shape over them, as one picture.
    pub contact_sheet: PathBuf,
    /// The content of `result.json`.
    pub result: RunResult,
    /// What speaks against the result.
    pub doubts: Doubts,
}

/// What an input's units may be in diagonals of the object: far more than any, and far less than what a diverged solve gives.
pub(super) const SCALES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;
/// Diagonals; an orthographic camera may be passed off as one that is far away.
pub(super) const MAX_TRANSLATION: f64 = 1e9;

/// Frames on a result's contact sheet.
const SHOWN: usize = 16;

/// Writes the result folder `out`: complete, or not at all. Refuses an `out` that exists and values that are not
/// finite.
pub fn write(input: &ReportInput, out: &Path) -> Result<Written, ReportError> {
    let (sequence, estimate) = (input.sequence, &input.solution.estimate);
    let poses = check(input)?;
    let object_from_input = estimate.object_from_input(sequence);
    let staging = Staging::beside(out)?;
    let (depth_folder, overlay_folder) = (staging.folder("depth")?, staging.folder("overlay")?);
    let mask_folder = match input.masks_anew {
        [] => None,
        _ => Some(staging.folder("masks")?),
    };

    let stems = file_stems(sequence.frames.iter().map(|frame| frame.name.as_str()));
    let mut gatherer = ColourGatherer::new(input.surface.points().len());
    let mut texture = input.surface.mesh().map(TextureGatherer::new);
    let mut colmap = ColmapModel::new(input.surface.points().len());
    let mut sheet = Sheet::new(&sequence.frames, SHOWN);
    let mut frames = Vec::new();
    let gains = gains(input.surface, &sequence.frames, &poses);
    for (i, ((frame, pose), stem)) in sequence.frames.iter().zip(&poses).zip(&stems).enumerate() {
        let view = input.surface.render(&frame.camera, pose, frame.image.size());
        let silhouette = view.mask();
        let deviations = input.solution.deviations.as_ref();
        let result = FrameResult {
            deviation: deviations.and_then(|deviations| deviations.cameras.get(i).copied()),
            ..FrameResult::new(
                &frame.name,
                pose,
                silhouette_iou(&silhouette, &frame.mask),
                density(&frame.mask, &silhouette),
            )
        };
        gatherer.add(frame, pose, input.surface, &view, gains[i]);
        if let Some(texture) = &mut texture {
            texture.add(frame, pose, &view, input.surface.spacing(), gains[i]);
        }
        if let Some(folder) = &mask_folder
            && input.masks_anew.contains(&frame.name)
        {
            write_mask(&frame.mask, &folder.join(format!("{stem}.png")))?;
        }
        colmap.add(&frame.name, &frame.camera, pose, input.surface, &view);
        write_depth(&view.depth, &depth_folder.join(format!("{stem}.exr")))?;
        let overlay = overlay::overlay(&frame.image, &view.depth, &frame.mask);
        save_png(&overlay_folder.join(format!("{stem}.png")), &overlay)?;
        sheet.add(
            i,
            &frame.name,
            format!("IoU {:.3}", result.silhouette_iou),
            &overlay::picture(&frame.image),
            &overlay,
        );
        frames.push(result);
    }
    save_png(&staging.path().join("overlay.png"), &sheet.draw())?;

    let colours = gatherer.finish(input.surface);
    let texture = texture.map(TextureGatherer::finish);
    write_shapes(
        &staging.path(),
        input.surface,
        &colours,
        (texture.as_ref(), metres_per_unit(input)),
        object_from_input,
    )?;
    colmap.write(&staging.folder("colmap")?, input.surface, &colours.rgb)?;
    let times: Vec<_> = sequence.frames.iter().map(|frame| frame.timestamp_s).collect();
    staging.text("cameras.txt", &trajectory::tum(&poses, &times))?;
    staging.text("trace.csv", &trace::csv(&input.solution.trace))?;
    staging.text("config.toml", input.config)?;
    let result = summarise(input, frames, object_from_input);
    staging.text("result.json", &result.to_json()?)?;
    let doubts = write_page(&staging.path(), sequence, input.focal_deviation)?;
    staging.publish()?;
    Ok(Written {
        folder: out.to_owned(),
        page: out.join(PAGE),
        contact_sheet: out.join("overlay.png"),
        result,
        doubts,
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
    if input.surface.points().is_empty() {
        return Err(ReportError::EmptyShape);
    }
    let shape = input.surface.points().iter().chain(input.surface.normals());
    if !shape.flatten().all(|&value| (value as f32).is_finite()) {
        return Err(ReportError::NotFinite {
            field: "the shape".to_owned(),
        });
    }
    let scaled = frames.iter().any(|frame| frame.camera_from_input.is_some());
    if scaled && !SCALES.contains(&estimate.alpha) {
        return Err(ReportError::NoScale {
            alpha: estimate.alpha,
        });
    }
    let poses: Vec<_> = (0..frames.len())
        .map(|frame| estimate.camera_from_object[frame])
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
        if pose.translation.norm() > MAX_TRANSLATION {
            return Err(ReportError::FarAway {
                frame: frame.name.clone(),
                away: pose.translation.norm(),
            });
        }
    }
    Ok(poses)
}

/// What one object unit is in metres, by the shape's extent along z.
fn metres_per_unit(input: &ReportInput) -> Option<f64> {
    let along = || input.surface.points().iter().map(|point| point.z);
    let length = along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min);
    input.length_m.map(|metres| metres / length)
}

fn write_shapes(
    folder: &Path,
    surface: &Surface,
    colours: &Colours,
    (texture, metres_per_unit): (Option<&Texture>, Option<f64>),
    object_from_input: Option<Similarity>,
) -> Result<(), ReportError> {
    let origin = format!(
        "colour: {} points seen in the frames, {} unseen ones like their mirror twin (x to -x), {} the mean colour",
        colours.seen,
        colours.mirrored,
        surface.points().len() - colours.seen - colours.mirrored,
    );
    let frame = format!("object frame: {OBJECT_FRAME}");
    let comments = [frame.clone(), origin.clone()];
    let write = |name: &str, faces| {
        let vertices = Vertices {
            points: surface.points(),
            normals: surface.normals(),
            colours: &colours.rgb,
            deviations: surface.deviations(),
        };
        ply::write_shape(&folder.join(name), &vertices, faces, &comments)
    };
    write("shape.ply", None)?;
    if let Some(mesh) = surface.mesh() {
        write("mesh.ply", Some(surface.facets()))?;
        if let Some(texture) = texture {
            let path = folder.join("mesh.glb");
            glb::write_mesh(
                &path,
                (mesh, surface.deviations()),
                &texture.colours,
                &frame,
                metres_per_unit,
            )?;
            save_png(&folder.join("mesh_origin.png"), &texture.origin_picture())?;
        }
    }
    let Some(object_from_input) = object_from_input else {
        return Ok(());
    };
    let input_from_object = object_from_input.inverse();
    let points: Vec<_> = surface
        .points()
        .iter()
        .map(|point| input_from_object.transform(point))
        .collect();
    let normals: Vec<_> = surface
        .normals()
        .iter()
        .map(|normal| input_from_object.rotation * normal)
        .collect();
    let deviations = surface.deviations().iter();
    let deviations: Vec<f64> = deviations.map(|x| input_from_object.scale * x).collect();
    let comments = ["frame: that of the input's poses, its units".to_owned(), origin];
    let write = |name: &str, faces| {
        let vertices = Vertices {
            points: &points,
            normals: &normals,
            colours: &colours.rgb,
            deviations: &deviations,
        };
        ply::write_shape(&folder.join(name), &vertices, faces, &comments)
    };
    write("shape_input.ply", None)?;
    match surface.mesh() {
        Some(_) => write("mesh_input.ply", Some(surface.facets())),
        None => Ok(()),
    }
}

fn summarise(
    input: &ReportInput,
    frames: Vec<FrameResult>,
    object_from_input: Option<Similarity>,
) -> RunResult {
    let solution = input.solution;
    let deviations = input.surface.deviations();
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
        free_form: solution.free_form.clone(),
        canonical_from_shape: solution.canonical_from_shape.as_ref().map(SimilarityRecord::from),
        alpha: input
            .sequence
            .frames
            .iter()
            .any(scaled)
            .then_some(solution.estimate.alpha),
        focal_factor: solution.estimate.focal_factor,
        object_from_input: object_from_input.as_ref().map(SimilarityRecord::from),
        metres_per_unit: metres_per_unit(input),
        objective: ObjectiveSpan {
            start: solution.objective_start,
            end: solution.objective_end,
        },
        silhouette_iou_mean: mean(|frame| frame.silhouette_iou),
        density_mean: mean(|frame| frame.density),
        shape_deviation_median: (!deviations.is_empty()).then(|| median(deviations.iter().copied())),
        masks_anew: input.masks_anew.to_vec(),
        frames,
        evaluations: solution.evaluations,
        iterations: solution.iterations,
        termination: solution.termination,
        seconds,
        peak_memory_mb: input.peak_memory_mb,
        hypotheses: solution.hypotheses.clone(),
    }
}

pub(super) fn save_png(path: &Path, picture: &image::RgbImage) -> Result<(), ReportError> {
    let mut png = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut png, image::ImageFormat::Png)
        .map_err(|error| ReportError::format(path, error))?;
    write_whole(path, &png.into_inner()).map_err(ReportError::io(path))
}

#[cfg(test)]
mod tests;
