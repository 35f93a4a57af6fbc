//! `result.json`: what a solve found, in numbers (schema 2).

use super::ReportError;
use super::write::{MAX_TRANSLATION, SCALES};
use crate::geometry::{Matrix3, Pose, Rotation3, Similarity, Vector3};
use crate::solver::{CameraDeviation, Evaluations, HypothesisOutcome, ObjectiveValue, Termination};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The only schema that this version writes and reads.
const SCHEMA: u32 = 2;
/// The largest entry of RᵀR − 1 for which R still counts as a rotation.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// The content of `result.json`, key by key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// The version of this file's layout.
    pub schema: u32,
    /// The program's version.
    pub version: String,
    /// The input as the user gave it.
    pub input: String,
    /// The shape prior's name and version.
    pub prior: String,
    /// One entry per frame, in the sequence's order.
    pub frames: Vec<FrameResult>,
    /// The style s, S entries.
    pub style: Vec<f64>,
    /// g, the coordinates of the prior's free form that bends the shape of this style; empty without one.
    #[serde(default)]
    pub free_form: Vec<f64>,
    /// From the frame in which the prior puts the shape of `style` and `free_form` to the object frame, where they differ.
    #[serde(default)]
    pub canonical_from_shape: Option<SimilarityRecord>,
    /// α: x_cam = α x'_cam (Eq. 10); `None` where the input brings neither poses nor depth.
    pub alpha: Option<f64>,
    /// The factor by which the input's focal lengths were multiplied; 1 where they were held.
    #[serde(default = "one")]
    pub focal_factor: f64,
    /// The similarity from the input's frame to the object frame; `None` where the input brings no poses.
    pub object_from_input: Option<SimilarityRecord>,
    /// What one object unit is in metres, where the object's real length was given.
    #[serde(default)]
    pub metres_per_unit: Option<f64>,
    /// The objective at the solve's start and end.
    pub objective: ObjectiveSpan,
    /// The mean of the frames' silhouette IoU.
    pub silhouette_iou_mean: f64,
    /// The mean of the frames' density.
    pub density_mean: f64,
    /// Half of the shape's points have a smaller standard deviation; `None` where nothing says so.
    #[serde(default)]
    pub shape_deviation_median: Option<f64>,
    /// Names of the frames whose masks were decided anew where the shape did not explain them.
    #[serde(default)]
    pub masks_anew: Vec<String>,
    /// Evaluations of the main solve and of the free form's stage, counted by Ceres; short solves are left out.
    pub evaluations: Evaluations,
    /// Ceres iterations of the main solve and of the free form's stage; short solves are left out.
    pub iterations: usize,
    /// Why the last stage of the solve stopped.
    pub termination: Termination,
    /// Stage name → wall-clock seconds.
    pub seconds: BTreeMap<String, f64>,
    /// The most memory that the process used, MB (10⁶ bytes); `None` where the system does not tell.
    pub peak_memory_mb: Option<f64>,
    /// One entry per pose hypothesis, after its short solve.
    pub hypotheses: Vec<HypothesisOutcome>,
}

/// One frame of `result.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameResult {
    /// The frame's name.
    pub name: String,
    /// The rotation of `camera_from_object`, row by row; x right, y down, z forward in the camera.
    pub rotation: [[f64; 3]; 3],
    /// The translation of `camera_from_object`, object units.
    pub translation: [f64; 3],
    /// The camera's centre in the object frame.
    pub center: [f64; 3],
    /// The IoU of the projected shape and the given mask, in \[0, 1\].
    pub silhouette_iou: f64,
    /// The share of the given mask's pixels that visible projected points cover.
    pub density: f64,
    /// How sure the camera's pose is; `None` where nothing says so.
    #[serde(default)]
    pub deviation: Option<CameraDeviation>,
}

/// x_object = scale · rotation x_input + translation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimilarityRecord {
    /// The factor on lengths.
    pub scale: f64,
    /// The rotation, row by row.
    pub rotation: [[f64; 3]; 3],
    /// The translation, object units.
    pub translation: [f64; 3],
}

/// The objective before the first and after the last iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObjectiveSpan {
    /// The value before the first iteration.
    pub start: ObjectiveValue,
    /// The value after the last iteration.
    pub end: ObjectiveValue,
}

impl RunResult {
    /// The mean over the frames of how sure the cameras are; `None` where nothing says so.
    pub fn mean_camera_deviation(&self) -> Option<CameraDeviation> {
        let known: Vec<CameraDeviation> = self.frames.iter().filter_map(|frame| frame.deviation).collect();
        let mean = |of: fn(&CameraDeviation) -> f64| known.iter().map(of).sum::<f64>() / known.len() as f64;
        (!known.is_empty()).then(|| CameraDeviation {
            rotation_deg: mean(|of| of.rotation_deg),
            location: mean(|of| of.location),
        })
    }
}

impl FrameResult {
    /// The record of a frame: its name, its pose, and its two measures in \[0, 1\].
    pub fn new(name: &str, camera_from_object: &Pose, silhouette_iou: f64, density: f64) -> Self {
        Self {
            name: name.to_owned(),
            rotation: rows(&camera_from_object.rotation),
            translation: camera_from_object.translation.into(),
            center: camera_from_object.center().into(),
            silhouette_iou,
            density,
            deviation: None,
        }
    }

    /// The pose; `None` if `rotation` is no rotation matrix.
    pub fn camera_from_object(&self) -> Option<Pose> {
        let matrix = Matrix3::from(self.rotation).transpose();
        let off = (matrix.transpose() * matrix - Matrix3::identity()).amax();
        (off <= ROTATION_TOLERANCE && matrix.determinant() > 0.0).then(|| Pose {
            rotation: Rotation3::from_matrix_unchecked(matrix),
            translation: Vector3::from(self.translation),
        })
    }
}

impl From<&Similarity> for SimilarityRecord {
    fn from(similarity: &Similarity) -> Self {
        Self {
            scale: similarity.scale,
            rotation: rows(&similarity.rotation),
            translation: similarity.translation.into(),
        }
    }
}

impl From<&SimilarityRecord> for Similarity {
    /// The rotation is taken to be one.
    fn from(record: &SimilarityRecord) -> Self {
        Self {
            scale: record.scale,
            rotation: Rotation3::from_matrix_unchecked(Matrix3::from(record.rotation).transpose()),
            translation: Vector3::from(record.translation),
        }
    }
}

fn one() -> f64 {
    1.0
}

impl RunResult {
    pub(super) fn schema() -> u32 {
        SCHEMA
    }

    /// Reads `result.json` of a result folder.
    pub fn load(folder: &Path) -> Result<Self, ReportError> {
        let path = folder.join("result.json");
        let text = crate::files::read_text(&path).map_err(ReportError::io(&path))?;
        let value: serde_json::Value =
            serde_json::from_str(&text).map_err(|error| ReportError::format(&path, error))?;
        if value.get("schema") != Some(&SCHEMA.into()) {
            let message = format!(
                "schema must be {SCHEMA}, found {}; solve again with this version",
                value.get("schema").unwrap_or(&serde_json::Value::Null)
            );
            return Err(ReportError::format(&path, message));
        }
        let result: Self =
            serde_json::from_value(value).map_err(|error| ReportError::format(&path, error))?;
        match result.frames.iter().find(|f| f.camera_from_object().is_none()) {
            None => result.check(&path).map(|()| result),
            Some(frame) => {
                let message = format!("frames[{}].rotation is not a rotation; solve again", frame.name);
                Err(ReportError::format(&path, message))
            }
        }
    }

    /// Refuses numbers that no solve gives: whoever edits a result or makes one is to know.
    fn check(&self, path: &Path) -> Result<(), ReportError> {
        let mut numbers = vec![
            ("alpha".to_owned(), self.alpha.unwrap_or(1.0), SCALES),
            ("focal_factor".to_owned(), self.focal_factor, 0.05..=20.0),
        ];
        for (index, &style) in self.style.iter().enumerate() {
            numbers.push((format!("style[{index}]"), style, -1e3..=1e3));
        }
        for frame in &self.frames {
            for &value in &frame.translation {
                numbers.push((
                    format!("frames[{}].translation", frame.name),
                    value,
                    -MAX_TRANSLATION..=MAX_TRANSLATION,
                ));
            }
        }
        match numbers
            .into_iter()
            .find(|(_, value, within)| !within.contains(value))
        {
            None => Ok(()),
            Some((field, value, within)) => {
                let (least, most) = within.into_inner();
                let message = format!("{field} is {value:e}, {least:e} to {most:e} expected; solve again");
                Err(ReportError::format(path, message))
            }
        }
    }

    /// Writes pretty JSON; refuses numbers that JSON cannot hold.
    pub(super) fn to_json(&self) -> Result<String, ReportError> {
        if let Some(field) = self.first_not_finite() {
            return Err(ReportError::NotFinite { field });
        }
        serde_json::to_string_pretty(self)
            .map(|json| json + "\n")
            .map_err(|error| ReportError::format(Path::new("result.json"), error))
    }

    fn first_not_finite(&self) -> Option<String> {
        let objective = |value: &ObjectiveValue| {
            [
                value.total,
                value.photometric,
                value.silhouette,
                value.inverse_depth,
                value.style,
                value.motion,
                value.focal,
            ]
        };
        let mut numbers: Vec<(String, Vec<f64>)> = vec![
            ("style".into(), self.style.clone()),
            ("free_form".into(), self.free_form.clone()),
            ("alpha".into(), self.alpha.into_iter().collect()),
            ("focal_factor".into(), vec![self.focal_factor]),
            (
                "objective.start".into(),
                objective(&self.objective.start).to_vec(),
            ),
            ("objective.end".into(), objective(&self.objective.end).to_vec()),
            ("seconds".into(), self.seconds.values().copied().collect()),
            ("peak_memory_mb".into(), self.peak_memory_mb.into_iter().collect()),
        ];
        for (name, similarity) in [
            ("canonical_from_shape", &self.canonical_from_shape),
            ("object_from_input", &self.object_from_input),
        ] {
            numbers.extend(similarity.iter().map(|similarity| {
                let parts = [&[similarity.scale], &similarity.translation[..]].concat();
                (name.into(), parts)
            }));
        }
        numbers.extend(self.frames.iter().map(|frame| {
            let pose = [&frame.rotation.concat()[..], &frame.translation, &frame.center].concat();
            (format!("frames[{}]", frame.name), pose)
        }));
        numbers.extend(self.hypotheses.iter().enumerate().map(|(i, h)| {
            let values = [
                h.azimuth_deg,
                h.elevation_deg,
                h.roll_deg,
                h.template_iou,
                h.objective_start,
                h.objective_end,
            ];
            (format!("hypotheses[{i}]"), values.to_vec())
        }));
        numbers
            .into_iter()
            .find(|(_, values)| values.iter().any(|value| !value.is_finite()))
            .map(|(field, _)| field)
    }
}

fn rows(rotation: &Rotation3<f64>) -> [[f64; 3]; 3] {
    // nalgebra's arrays are columns: those of the transpose are our rows.
    rotation.matrix().transpose().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_written_row_by_row_and_read_back() {
        let pose = Pose {
            rotation: Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2),
            translation: Vector3::new(1.0, 2.0, 3.0),
        };
        let frame = FrameResult::new("a", &pose, 0.5, 0.25);
        // x goes to y: R e_x = e_y, so the first *column* is (0, 1, 0).
        assert!((frame.rotation[1][0] - 1.0).abs() < 1e-12);
        assert!((frame.rotation[0][1] + 1.0).abs() < 1e-12);
        // R c + t = 0.
        assert!((Vector3::from(frame.center) - Vector3::new(-2.0, 1.0, -3.0)).norm() < 1e-12);
        let back = frame.camera_from_object().unwrap();
        assert!((back.rotation.matrix() - pose.rotation.matrix()).norm() < 1e-12);
        let mirrored = FrameResult {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
            ..frame
        };
        assert!(mirrored.camera_from_object().is_none());
    }

    #[test]
    fn another_schema_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("result.json"), "{\"schema\": 1}").unwrap();
        let error = RunResult::load(folder.path()).unwrap_err().to_string();
        assert!(
            error.contains("result.json: schema must be 2, found 1"),
            "{error}"
        );
    }
}
