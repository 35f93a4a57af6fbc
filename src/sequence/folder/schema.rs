//! `sequence.toml`, schema 1, as it stands in the file.

use serde::Deserialize;

pub(super) const SCHEMA: u32 = 1;

/// Read first, alone: a later schema's keys are unknown here and would hide the real reason.
#[derive(Deserialize)]
pub(super) struct Version {
    pub schema: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    #[serde(rename = "schema")]
    _schema: u32,
    pub motion_deviation: Option<f64>,
    pub focal_deviation: Option<f64>,
    pub frames: Vec<FrameEntry>,
    pub truth: Option<TruthEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrameEntry {
    pub name: String,
    pub image: String,
    pub mask: String,
    pub timestamp_s: Option<f64>,
    pub camera: CameraEntry,
    pub camera_from_input: Option<PoseEntry>,
    pub depth: Option<String>,
    pub depth_deviation: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraEntry {
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseEntry {
    /// Row-major.
    pub rotation: [[f64; 3]; 3],
    pub translation: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TruthEntry {
    pub shape: String,
    pub depth: Vec<String>,
    pub camera_from_object: Vec<PoseEntry>,
}
