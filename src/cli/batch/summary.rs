//! What came out of a list, in a table.

use super::list::Job;
use anyhow::Context;
use spba_ceres::config::Config;
use spba_ceres::report::{RunResult, doubts};
use spba_ceres::solver::Termination;
use std::fmt;
use std::path::Path;

/// What became of one sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome {
    Usable,
    InDoubt,
    NotUsable,
    Interrupted,
    /// No result, but a log.
    Failed,
    NotStarted,
}

impl fmt::Display for Outcome {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.pad(match self {
            Self::Usable => "usable",
            Self::InDoubt => "in doubt",
            Self::NotUsable => "not usable",
            Self::Interrupted => "interrupted",
            Self::Failed => "failed",
            Self::NotStarted => "not started",
        })
    }
}

/// One line of the table.
pub(super) struct Row {
    pub name: String,
    pub outcome: Outcome,
    numbers: Option<Numbers>,
    /// Why there is no result, or what is in doubt of it.
    words: String,
}

struct Numbers {
    frames: usize,
    silhouette_iou: f64,
    density: f64,
    iterations: usize,
    seconds: f64,
}

impl Row {
    pub fn read(job: &Job, out: &Path) -> Self {
        let mut row = Self {
            name: job.name.clone(),
            outcome: Outcome::NotStarted,
            numbers: None,
            words: String::new(),
        };
        let folder = job.result(out);
        if folder.exists() {
            match (
                RunResult::load(&folder),
                Config::load(&folder.join("config.toml")),
            ) {
                (Ok(result), Ok(config)) => row.judge(&result, &config),
                (Err(error), _) => row.fail(error.to_string()),
                (_, Err(error)) => row.fail(error.to_string()),
            }
        } else if let Ok(log) = std::fs::read_to_string(out.join(format!("{}.log", job.name))) {
            let said = log.lines().rev().find_map(|line| line.strip_prefix("error: "));
            row.fail(said.unwrap_or("it ended without a word").to_owned());
        }
        row
    }

    fn fail(&mut self, words: String) {
        self.outcome = Outcome::Failed;
        self.words = words;
    }

    fn judge(&mut self, result: &RunResult, config: &Config) {
        let focal_deviation = config.objective.focal_deviation.unwrap_or(0.0);
        let doubts = doubts(
            &result.frames,
            (&result.style, &result.free_form),
            result.focal_factor,
            focal_deviation,
        );
        self.outcome = match (result.termination, doubts.explained, doubts.words.is_empty()) {
            (Termination::Interrupted, _, _) => Outcome::Interrupted,
            (_, false, _) => Outcome::NotUsable,
            (_, true, false) => Outcome::InDoubt,
            (_, true, true) => Outcome::Usable,
        };
        self.words = doubts.words.join("; ");
        let wall = result
            .seconds
            .iter()
            .filter(|(stage, _)| !stage.ends_with("_cpu"));
        self.numbers = Some(Numbers {
            frames: result.frames.len(),
            silhouette_iou: result.silhouette_iou_mean,
            density: result.density_mean,
            iterations: result.iterations,
            seconds: wall.map(|(_, seconds)| seconds).sum(),
        });
    }

    /// Whether there is a result that `solve` itself would end with status 0 for.
    pub fn is_usable(&self) -> bool {
        matches!(self.outcome, Outcome::Usable | Outcome::InDoubt)
    }

    /// Whether it is to be solved, for the first time or again.
    pub fn is_open(&self) -> bool {
        matches!(
            self.outcome,
            Outcome::Interrupted | Outcome::Failed | Outcome::NotStarted
        )
    }

    fn cells(&self) -> [String; 8] {
        let number = |of: fn(&Numbers) -> String| self.numbers.as_ref().map_or_else(String::new, of);
        [
            self.name.clone(),
            self.outcome.to_string(),
            number(|n| n.frames.to_string()),
            number(|n| format!("{:.3}", n.silhouette_iou)),
            number(|n| format!("{:.3}", n.density)),
            number(|n| n.iterations.to_string()),
            number(|n| format!("{:.1}", n.seconds)),
            self.words.clone(),
        ]
    }
}

const HEADINGS: [&str; 8] = [
    "name",
    "outcome",
    "frames",
    "silhouette_iou",
    "density",
    "iterations",
    "seconds",
    "words",
];

/// For people: in columns, without the words.
pub(super) fn table(rows: &[Row]) -> String {
    let mut lines = vec![HEADINGS.map(|heading| heading.replace('_', " "))];
    lines.extend(rows.iter().map(Row::cells));
    let width = |column: usize| lines.iter().map(|cells| cells[column].len()).max().unwrap_or(0);
    let widths: [usize; 7] = std::array::from_fn(width);
    let mut text = String::new();
    for cells in &lines {
        let padded = cells
            .iter()
            .zip(widths)
            .enumerate()
            .map(|(column, (cell, width))| {
                // Numbers end, names begin in one column.
                if column < 2 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        let line: Vec<String> = padded.collect();
        text += line.join("  ").trim_end();
        text += "\n";
    }
    text
}

/// For programs: RFC 4180.
pub(super) fn write_csv(rows: &[Row], path: &Path) -> anyhow::Result<()> {
    let mut text = HEADINGS.join(",") + "\n";
    for row in rows {
        let cells = row.cells().map(|cell| match cell.contains([',', '"', '\n']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell,
        });
        text += &(cells.join(",") + "\n");
    }
    std::fs::write(path, text).with_context(|| path.display().to_string())
}
