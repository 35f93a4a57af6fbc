//! Fig. 8: the pose at convergence against the pose at the start.

use super::measures::mean;
use super::plot::{Axis, Chart, Line};
use super::subject::short_solves;
use super::table::cell;
use super::{Effort, Jobs, Method, StudyError, Subject, Table, perturbed_start};
use crate::eval::{location_error, orientation_error_deg};
use crate::init::Estimate;
use crate::prior::{self, ShapePrior};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// Errors of p0, the target frame's pose, at the start.
const ANGLES_DEG: [f64; 6] = [5.0, 10.0, 15.0, 20.0, 30.0, 40.0];
/// The shift of the target's camera, as a share of its distance.
const SHIFT: f64 = 0.05;
/// Directions of the error per sequence; no two sequences share one.
const SEEDS: u64 = 1;

/// A method's error from one perturbed start.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    pub sequence: String,
    pub method: String,
    pub start_deg: f64,
    pub seed: u64,
    /// The orientation error of p0 at convergence, degrees.
    pub orientation_error_deg: f64,
    pub location_error_percent: f64,
}

/// The records of Fig. 8: errors against the perturbation of the start.
#[derive(Clone, Debug, Serialize)]
pub struct Fig8 {
    /// One entry per sequence, method and start.
    pub points: Vec<Point>,
}

#[derive(Serialize, Deserialize)]
struct Perturbed {
    estimate: Estimate,
}

/// Ours from the perturbed pose, with the short solve that every pose hypothesis gets and without it, and Zhu et al.;
/// runs what is missing. Sequences without truth are left out.
pub fn fig8(
    subjects: impl IntoIterator<Item = Result<Subject, StudyError>>,
    jobs: &Jobs,
    effort: Effort,
) -> Result<Fig8, StudyError> {
    let angles = match effort {
        Effort::Full => &ANGLES_DEG[..],
        Effort::Quick => &ANGLES_DEG[..1],
    };
    let ours = Method::ours().with(effort);
    let mut zhu = Method::zhu()?.with(effort);
    // The perturbed frame is the target of all three.
    zhu.config.input.target = None;
    let mut points = Vec::new();
    for (subject, first_seed) in subjects.into_iter().zip((0..).step_by(SEEDS as usize)) {
        let subject = subject?;
        let target = subject.sequence.frames.len() / 2;
        let sequence = &subject.sequence;
        let Some(truth) = sequence
            .truth
            .as_ref()
            .map(|truth| truth.camera_from_object[target])
        else {
            continue;
        };
        let learned = prior::find(&ours.config.prior)?;
        let prior: Arc<dyn ShapePrior> = Arc::new(learned.clone());
        let mut starts = Vec::new();
        for &angle_deg in angles {
            for seed in first_seed..first_seed + SEEDS {
                if let Some(start) = perturbed_start(sequence, &learned, target, angle_deg, SHIFT, seed) {
                    starts.push((angle_deg, seed, start));
                }
            }
        }
        let footage = subject.footage(ours.config.solver.levels)?;
        let name = |angle_deg: f64, seed: u64| format!("{}/from-{angle_deg}-deg-{seed}", subject.name);
        let placed: Vec<Perturbed> = jobs.run(
            &starts,
            |(angle_deg, seed, _)| name(*angle_deg, *seed) + "-short",
            |(_, _, start)| Ok(json!([subject.digest(), start])),
            |(angle_deg, seed, start), observer| {
                let starts = std::slice::from_ref(start);
                let short = short_solves(&footage, &prior, target, starts, observer, || {
                    name(*angle_deg, *seed)
                })?;
                Ok(Perturbed {
                    estimate: short.estimate,
                })
            },
        )?;
        let runs: Vec<Run> = starts
            .iter()
            .zip(&placed)
            .flat_map(|((angle_deg, seed, start), placed)| {
                runs_from(*angle_deg, *seed, start, &placed.estimate, &ours, &zhu)
            })
            .collect();
        let methods: Vec<_> = runs
            .iter()
            .map(|(_, _, method, start)| (method.clone(), start.clone()))
            .collect();
        for ((angle_deg, seed, method, _), run) in runs.iter().zip(subject.runs(jobs, &methods)?) {
            let found = run.estimate.camera_from_object[target];
            points.push(Point {
                sequence: subject.name.clone(),
                method: method.label.clone(),
                start_deg: *angle_deg,
                seed: *seed,
                orientation_error_deg: orientation_error_deg(&found.rotation, &truth.rotation),
                location_error_percent: 100.0 * location_error(&found, &truth),
            });
        }
    }
    Ok(Fig8 { points })
}

impl Fig8 {
    /// The numbers behind the figure: a row per sequence, method and start.
    pub fn table(&self) -> Table {
        let mut table = Table::new(&[
            "method",
            "sequence",
            "start_deg",
            "seed",
            "orientation_error_deg",
            "location_error_percent",
        ]);
        for point in &self.points {
            table.rows.push(vec![
                point.method.clone(),
                point.sequence.clone(),
                format!("{}", point.start_deg),
                point.seed.to_string(),
                cell(Some(point.orientation_error_deg), 4),
                cell(Some(point.location_error_percent), 4),
            ]);
        }
        table
    }

    /// Mean orientation error at convergence over sequences and seeds, by method and start.
    pub fn summary(&self) -> Table {
        let mut table = Table::new(&["start, deg"]);
        let methods = self.methods();
        table
            .headings
            .extend(methods.iter().map(|&method| method.to_owned()));
        for angle in ANGLES_DEG {
            let cells: Vec<_> = methods.iter().map(|method| self.mean_of(method, angle)).collect();
            if cells.iter().any(Option::is_some) {
                let row = std::iter::once(angle.to_string());
                table
                    .rows
                    .push(row.chain(cells.into_iter().map(|value| cell(value, 3))).collect());
            }
        }
        table
    }

    fn methods(&self) -> Vec<&str> {
        let mut methods: Vec<&str> = Vec::new();
        for point in &self.points {
            if !methods.contains(&point.method.as_str()) {
                methods.push(&point.method);
            }
        }
        methods
    }

    fn mean_of(&self, method: &str, angle_deg: f64) -> Option<f64> {
        let there = self.points.iter();
        let there = there.filter(|point| point.method == method && point.start_deg == angle_deg);
        mean(there.map(|point| point.orientation_error_deg))
    }

    /// `fig8.svg`: the summary drawn.
    pub fn draw(&self, folder: &Path) -> Result<(), StudyError> {
        let lines = self.methods().into_iter().map(|method| Line {
            label: method.to_owned(),
            points: ANGLES_DEG
                .iter()
                .filter_map(|&angle| Some((angle, self.mean_of(method, angle)?)))
                .collect(),
            joined: true,
        });
        Chart {
            title: "p0 at convergence against p0 at the start",
            x: Axis::linear("orientation error at the start, degrees"),
            y: Axis::logarithmic("orientation error at convergence, degrees"),
            lines: lines.collect(),
        }
        .write(&folder.join("fig8.svg"))
    }
}

/// The angle and seed of a perturbed start, who goes on from it, and where from.
type Run = (f64, u64, Method, Estimate);

/// All three that go on from one perturbed start, which the short solve makes `placed`.
fn runs_from(
    angle_deg: f64,
    seed: u64,
    start: &Estimate,
    placed: &Estimate,
    ours: &Method,
    zhu: &Method,
) -> [Run; 3] {
    let run = |method: &Method, name: &str, label: &str, start: &Estimate| {
        let named = Method {
            name: format!("from-{angle_deg}-deg-{seed}-{name}"),
            label: label.to_owned(),
            config: method.config.clone(),
        };
        (angle_deg, seed, named, start.clone())
    };
    [
        run(ours, &ours.name, "ours", placed),
        run(ours, "unplaced", "ours without the short solve", start),
        run(zhu, &zhu.name, "Zhu et al.", start),
    ]
}
