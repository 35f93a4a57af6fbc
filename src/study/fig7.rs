//! Fig. 7: depth error against the number of frames.

use super::measures::mean;
use super::plot::{Axis, Chart, Line};
use super::table::cell;
use super::{Effort, Jobs, Measures, Method, StudyError, Subject, Table};
use serde::Serialize;
use std::path::Path;

/// Errors on one sequence with one number of frames.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    pub sequence: String,
    pub frames: usize,
    pub ours: Measures,
    pub input: Measures,
    pub cpu_seconds: f64,
}

/// The records of Fig. 7: errors against the number of frames.
#[derive(Clone, Debug, Serialize)]
pub struct Fig7 {
    /// One entry per sequence and number of frames.
    pub points: Vec<Point>,
}

/// Runs what is missing; sequences of the same name but for the number of frames belong together.
pub fn fig7(
    subjects: impl IntoIterator<Item = Result<Subject, StudyError>>,
    jobs: &Jobs,
    effort: Effort,
) -> Result<Fig7, StudyError> {
    let mut points = Vec::new();
    for subject in subjects {
        let subject = subject?;
        let start = subject.start(jobs, effort)?.short;
        for run in subject.runs(jobs, &[(Method::ours().with(effort), start)])? {
            points.push(Point {
                sequence: subject.name.clone(),
                frames: subject.sequence.frames.len(),
                ours: run.measures,
                input: Measures::of_input(&subject.sequence, None),
                cpu_seconds: run.cpu_seconds,
            });
        }
    }
    Ok(Fig7 { points })
}

impl Fig7 {
    /// The numbers behind the figure: a row per sequence and number of frames.
    pub fn table(&self) -> Table {
        let mut table = Table::new(&[
            "sequence",
            "frames",
            "depth_error",
            "depth_error_at_best_scale",
            "depth_error_input",
            "orientation_error_deg",
            "location_error_percent",
            "chamfer_percent",
            "cpu_seconds",
        ]);
        for point in &self.points {
            table.rows.push(vec![
                point.sequence.clone(),
                point.frames.to_string(),
                cell(point.ours.depth_error, 5),
                cell(point.ours.depth_error_at_best_scale, 5),
                cell(point.input.depth_error, 5),
                cell(point.ours.orientation_error_deg, 4),
                cell(point.ours.location_error_percent, 4),
                cell(point.ours.chamfer_percent, 4),
                cell(Some(point.cpu_seconds), 1),
            ]);
        }
        table
    }

    /// `fig7.svg`: means over the sequences.
    pub fn draw(&self, folder: &Path) -> Result<(), StudyError> {
        let mut counts: Vec<usize> = self.points.iter().map(|point| point.frames).collect();
        counts.sort_unstable();
        counts.dedup();
        let line = |label: &str, value: fn(&Point) -> Option<f64>| Line {
            label: label.to_owned(),
            points: counts
                .iter()
                .filter_map(|&count| {
                    let there = self.points.iter().filter(|point| point.frames == count);
                    Some((count as f64, mean(there.filter_map(value))?))
                })
                .collect(),
            joined: true,
        };
        Chart {
            title: "Depth error against the number of frames",
            x: Axis::logarithmic("frames"),
            y: Axis::linear("depth error, diagonals"),
            lines: vec![
                line("ours", |point| point.ours.depth_error),
                line("ours at the best scale", |point| {
                    point.ours.depth_error_at_best_scale
                }),
                line("off-the-shelf input (semi-dense)", |point| {
                    point.input.depth_error
                }),
            ],
        }
        .write(&folder.join("fig7.svg"))
    }
}
