//! What the page shows in numbers, in the order and the units in which it shows them.

use super::encode::{self, Layers};
use crate::geometry::{Pinhole, Pose, Similarity};
use crate::image::{DepthMap, read_depth};
use crate::report::{ReportError, RunResult, file_stems, overlay, style_length};
use crate::sequence::{self, Sequence};
use crate::solver::{CameraDeviation, TraceRow};
use serde::Serialize;
use std::path::Path;

/// One frame, its pictures included.
#[derive(Serialize)]
pub(super) struct Frame {
    pub name: String,
    /// Width and height, pixels.
    size: (usize, usize),
    camera: Pinhole,
    /// `camera_from_object`, row by row.
    rotation: [[f64; 3]; 3],
    /// `camera_from_object`, diagonals of the object.
    translation: [f64; 3],
    /// The picture, a `data:` address.
    picture: String,
    /// What lies over it, likewise: [`Layers::encode`].
    layers: String,
    /// z at the far and the near end of the colour scale, diagonals of the object.
    depth_range: (f32, f32),
    has_input_depth: bool,
    silhouette_iou: f64,
    density: f64,
    /// How sure the camera's pose is; `None` where nothing says so.
    deviation: Option<CameraDeviation>,
    /// By which the object turned since the frame before, as the camera sees it; `None` in the first.
    pub turn_deg: Option<f64>,
    /// By which the input's pose has the object turned otherwise, both frames of reference laid upon each other; `None` where the input has
    /// no pose.
    input_turn_deg: Option<f64>,
    /// Whether its mask was decided anew.
    mask_anew: bool,
}

/// All frames of a result, their depths read from its folder.
pub(super) fn frames(
    folder: &Path,
    sequence: &Sequence,
    result: &RunResult,
) -> Result<Vec<Frame>, ReportError> {
    let stems = file_stems(result.frames.iter().map(|frame| frame.name.as_str()));
    let poses: Vec<_> = result
        .frames
        .iter()
        .map(|frame| frame.camera_from_object().unwrap_or(Pose::identity()))
        .collect();
    let object_from_input = result.object_from_input.as_ref().map(Similarity::from);
    let frames = sequence.frames.iter().zip(&result.frames).zip(&stems).enumerate();
    let frames = frames.map(|(index, ((given, found), stem))| {
        let path = folder.join("depth").join(format!("{stem}.exr"));
        let depth = read_depth(&path)?;
        if depth.size() != given.image.size() {
            let message = "its size is not its frame's; solve again";
            return Err(ReportError::format(&path, message));
        }
        let range = overlay::inverse_depth_range(&depth);
        let input_depth = input_depth(given, result.alpha);
        let layers = Layers {
            image: &given.image,
            mask: &given.mask,
            depth: &depth,
            input_depth: input_depth.as_ref(),
            range,
        };
        let scale = encode::scale(given.image.size(), sequence.frames.len());
        let [picture, layers] = layers
            .encode(scale)
            .map_err(|error| ReportError::format(&path, error))?;
        let pose = &poses[index];
        let before = index.checked_sub(1).map(|before| &poses[before]);
        let input_turn = object_from_input
            .zip(given.camera_from_input)
            .map(|(join, input)| {
                let expected = input.rotation * join.rotation.inverse();
                pose.rotation.angle_to(&expected).to_degrees()
            });
        Ok(Frame {
            name: given.name.clone(),
            size: given.image.size(),
            camera: given.camera,
            rotation: found.rotation,
            translation: found.translation,
            picture,
            layers,
            depth_range: (inverse(range.0), inverse(range.1)),
            has_input_depth: input_depth.is_some(),
            silhouette_iou: found.silhouette_iou,
            density: found.density,
            deviation: found.deviation,
            turn_deg: before.map(|before| pose.rotation.angle_to(&before.rotation).to_degrees()),
            input_turn_deg: input_turn,
            mask_anew: result.masks_anew.contains(&found.name),
        })
    });
    frames.collect()
}

fn inverse(value: f32) -> f32 {
    if value > 0.0 { 1.0 / value } else { 0.0 }
}

/// The mean absolute depth difference, object units, inside the mask.
fn input_depth(frame: &sequence::Frame, alpha: Option<f64>) -> Option<DepthMap> {
    let (depth, alpha) = (frame.depth.as_ref()?, alpha? as f32);
    Some(DepthMap::from_fn(depth.width(), depth.height(), |column, row| {
        if frame.mask[(column, row)] {
            alpha * depth[(column, row)]
        } else {
            0.0
        }
    }))
}

/// The terms of the objective over the iterations of the main solve, hypotheses left out.
#[derive(Serialize)]
pub(super) struct Objective {
    /// Name and values of the total and of every term that is not 0 throughout.
    terms: Vec<(&'static str, Vec<f64>)>,
    /// Name and first iteration of every stage.
    stages: Vec<(String, usize)>,
}

impl Objective {
    pub fn of(trace: &[TraceRow]) -> Self {
        let rows = main_rows(trace);
        let value = |name, of: fn(&TraceRow) -> f64| (name, rows.iter().map(|row| of(row)).collect());
        let mut terms: Vec<(&str, Vec<f64>)> = vec![
            value("total", |row| row.objective.total),
            value("photometric", |row| row.objective.photometric),
            value("silhouette", |row| row.objective.silhouette),
            value("inverse depth", |row| row.objective.inverse_depth),
            value("style", |row| row.objective.style),
            value("motion", |row| row.objective.motion),
            value("focal", |row| row.objective.focal),
        ];
        terms.retain(|(_, values)| values.iter().any(|&value| value != 0.0));
        let mut stages: Vec<(String, usize)> = Vec::new();
        for (iteration, row) in rows.iter().enumerate() {
            if stages.last().is_none_or(|(stage, _)| *stage != row.stage) {
                stages.push((row.stage.clone(), iteration));
            }
        }
        Self { terms, stages }
    }
}

/// The rows of the solve that the result comes from.
pub(super) fn main_rows(trace: &[TraceRow]) -> Vec<&TraceRow> {
    let short = |row: &&TraceRow| !row.stage.contains("hypothesis");
    trace.iter().filter(short).collect()
}

/// The style against the prior's distribution, in which every entry is standard normal.
#[derive(Serialize)]
pub(super) struct Style {
    entries: Vec<f64>,
    /// Lengths of style and free form in the usual one, the root of the number of entries; `None` without a free form.
    length: f64,
    free_form_length: Option<f64>,
}

impl Style {
    pub fn of(result: &RunResult) -> Self {
        let free_form = &result.free_form;
        Self {
            entries: result.style.clone(),
            length: style_length(&result.style),
            free_form_length: (!free_form.is_empty()).then(|| style_length(free_form)),
        }
    }
}

/// A number at the top of the page, what it is, and what is to be known of it.
#[derive(Serialize)]
pub(super) struct Tile {
    value: String,
    what: &'static str,
    note: String,
}

pub(super) fn tiles(result: &RunResult) -> Vec<Tile> {
    let tile = |value: String, what, note: String| Tile { value, what, note };
    let least = |of: fn(&crate::report::FrameResult) -> f64| {
        result.frames.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    let wall = |name: &str| !name.ends_with("_cpu");
    let seconds: f64 = result
        .seconds
        .iter()
        .filter(|(name, _)| wall(name))
        .map(|(_, seconds)| seconds)
        .sum();
    let mut tiles = vec![
        tile(
            format!("{:.3}", result.silhouette_iou_mean),
            "silhouette IoU",
            format!("mean; least {:.3}", least(|frame| frame.silhouette_iou)),
        ),
        tile(
            format!("{:.3}", result.density_mean),
            "density",
            format!("mean; least {:.3}", least(|frame| frame.density)),
        ),
        tile(
            format!("{:.2}", style_length(&result.style)),
            "style length",
            "1 is usual of the prior".to_owned(),
        ),
        tile(
            result.frames.len().to_string(),
            "frames",
            format!("{} iterations", result.iterations),
        ),
        tile(
            format!("{seconds:.1} s"),
            "time",
            result
                .peak_memory_mb
                .map_or_else(String::new, |memory| format!("{memory:.0} MB at most")),
        ),
    ];
    if let Some(cameras) = result.mean_camera_deviation() {
        let shape = result
            .shape_deviation_median
            .map_or_else(String::new, |shape| format!(", shape ± {:.1} %", 100.0 * shape));
        tiles.insert(
            2,
            tile(
                format!("± {:.2}°", cameras.rotation_deg),
                "camera rotation",
                format!("location ± {:.1} %{shape}", 100.0 * cameras.location),
            ),
        );
    }
    tiles
}

/// A stage's name with its wall-clock and processor seconds.
#[derive(Serialize)]
pub(super) struct Seconds {
    stage: String,
    wall: String,
    cpu: String,
}

pub(super) fn seconds(result: &RunResult) -> Vec<Seconds> {
    let words = |seconds: &f64| format!("{seconds:.2}");
    let stages = result.seconds.iter().filter(|(name, _)| !name.ends_with("_cpu"));
    stages
        .map(|(stage, wall)| Seconds {
            stage: stage.replace('_', " "),
            wall: words(wall),
            cpu: result
                .seconds
                .get(&format!("{stage}_cpu"))
                .map_or_else(String::new, words),
        })
        .collect()
}

/// A pose hypothesis in words.
#[derive(Serialize)]
pub(super) struct Hypothesis {
    azimuth: String,
    elevation: String,
    roll: String,
    template_iou: String,
    start: String,
    end: String,
    chosen: bool,
}

/// Best first.
pub(super) fn hypotheses(result: &RunResult) -> Vec<Hypothesis> {
    let mut sorted: Vec<_> = result.hypotheses.iter().collect();
    sorted.sort_by(|a, b| a.objective_end.total_cmp(&b.objective_end));
    let degrees = |angle: f64| format!("{angle:.1}°");
    sorted
        .into_iter()
        .map(|hypothesis| Hypothesis {
            azimuth: degrees(hypothesis.azimuth_deg),
            elevation: degrees(hypothesis.elevation_deg),
            roll: degrees(hypothesis.roll_deg),
            template_iou: format!("{:.3}", hypothesis.template_iou),
            start: format!("{:.0}", hypothesis.objective_start),
            end: format!("{:.0}", hypothesis.objective_end),
            chosen: hypothesis.chosen,
        })
        .collect()
}

/// A file of the folder and what it holds.
#[derive(Serialize)]
pub(super) struct File {
    name: &'static str,
    what: &'static str,
}

/// What a result folder may hold, the most useful first.
const FILES: [File; 14] = [
    File {
        name: "mesh.glb",
        what: "the shape as a textured mesh, object frame: opens in Blender and every glTF viewer",
    },
    File {
        name: "mesh.ply",
        what: "the same mesh with a colour a vertex",
    },
    File {
        name: "shape.ply",
        what: "points of the whole shape with normals and colours, object frame",
    },
    File {
        name: "mesh_input.ply",
        what: "the mesh in the frame and units of the input's poses",
    },
    File {
        name: "shape_input.ply",
        what: "the points in the frame and units of the input's poses",
    },
    File {
        name: "mesh_origin.png",
        what: "where the texture comes from: frames, mirror image, neighbours",
    },
    File {
        name: "cameras.txt",
        what: "cameras as a TUM trajectory, object_from_camera",
    },
    File {
        name: "colmap",
        what: "a COLMAP text model: cameras, poses, points",
    },
    File {
        name: "depth",
        what: "z of the shape per frame, object units, 0 = none",
    },
    File {
        name: "masks",
        what: "masks that were decided anew",
    },
    File {
        name: "overlay.png",
        what: "all frames with the shape over them, one picture",
    },
    File {
        name: "result.json",
        what: "poses (camera_from_object), style, scale, measures",
    },
    File {
        name: "trace.csv",
        what: "every solver iteration",
    },
    File {
        name: "config.toml",
        what: "the configuration, as a file for --config",
    },
];

/// The files that exist.
pub(super) fn files(folder: &Path) -> Vec<&'static File> {
    FILES
        .iter()
        .filter(|file| folder.join(file.name).exists())
        .collect()
}
