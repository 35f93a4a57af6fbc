//! A comparison as charts, of the start of seed 0.

use super::{Comparison, JudgedState};
use crate::study::StudyError;
use crate::study::plot::{Axis, Chart, Line};
use std::path::Path;

/// The best itself has no place on a logarithmic axis.
const LEAST_SHARE: f64 = 1e-5;

impl Comparison {
    /// `compare-objective-iterations.svg`, `-evaluations.svg` and `-seconds.svg`: the judged objective above the best found; with
    /// truth, `compare-location-seconds.svg`, without which one of an earlier comparison is removed.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn draw(&self, folder: &Path) -> Result<(), StudyError> {
        let best = self.best(0);
        let above = |state: &JudgedState| (state.objective / best - 1.0).max(LEAST_SHARE);
        let objective = |name: &str, label, along: fn(&JudgedState) -> f64| {
            Chart {
                title: "Objective above the best found",
                x: Axis::linear(label),
                y: Axis::logarithmic("share above the best"),
                lines: self.lines(&|state| (along(state), above(state))),
            }
            .write(&folder.join(format!("compare-objective-{name}.svg")))
        };
        objective("iterations", "iterations", |state| state.iterations as f64)?;
        objective("evaluations", "evaluations, residual and Jacobian", |state| {
            state.evaluations as f64
        })?;
        objective("seconds", "processor seconds", |state| state.cpu_seconds)?;
        let path = folder.join("compare-location-seconds.svg");
        let mut states = self
            .minimisations
            .iter()
            .flat_map(|minimisation| &minimisation.states);
        if states.all(|state| state.location_error_percent.is_none()) {
            return match std::fs::remove_file(&path) {
                Err(problem) if problem.kind() != std::io::ErrorKind::NotFound => {
                    Err(StudyError::io(&path)(problem))
                }
                _ => Ok(()),
            };
        }
        Chart {
            title: "Camera location error",
            x: Axis::linear("processor seconds"),
            y: Axis::linear("% of the diagonal"),
            lines: self.lines(&|state| {
                (
                    state.cpu_seconds,
                    state.location_error_percent.unwrap_or(f64::NAN),
                )
            }),
        }
        .write(&path)
    }

    /// A line per minimiser through its judged states.
    fn lines(&self, place: &dyn Fn(&JudgedState) -> (f64, f64)) -> Vec<Line> {
        self.minimisations
            .iter()
            .filter(|minimisation| minimisation.seed == 0)
            .map(|minimisation| Line {
                label: minimisation.minimiser.clone(),
                points: minimisation.states.iter().map(place).collect(),
                joined: true,
            })
            .collect()
    }
}
