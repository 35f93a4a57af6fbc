//! Fig. 3: the cost over p0 and Δp around the optimum, and along p0 with and without the correct motion.

use super::plot::{Axis, Chart, Heat, Line};
use super::table::cell;
use super::{Effort, Jobs, Method, StudyError, Subject, Table};
use crate::geometry::{Pose, Rotation3, Vector3};
use crate::init::{Estimate, cameras_from_input};
use crate::objective::{Footage, Objective, ObjectiveError};
use crate::prior::{self, FreeForm, ShapePrior};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// The surface reaches so far on both sides of the optimum.
const REACH_DEG: f64 = 20.0;

/// Costs around the optimum of one sequence, by angles in degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fig3 {
    /// p0 turned about the object's vertical axis; ascending.
    pub angles_deg: Vec<f64>,
    /// `surface[i][j]`: photometric cost (Eq. 4) with p0 turned by `angles_deg[i]`, and every Δp_l's motion turned on by
    /// `angles_deg[j]` times l over the number of source frames.
    pub surface: Vec<Vec<f64>>,
    /// The whole objective along p0 with the motion that Eq. 13 gives for it.
    pub correct_motion: Vec<f64>,
    /// The same with no motion at all, as Zhu et al. start.
    pub no_motion: Vec<f64>,
}

/// Around the optimum that ours finds; from the cache if it is there.
pub fn fig3(subject: &Subject, jobs: &Jobs, effort: Effort) -> Result<Fig3, StudyError> {
    let half = if effort == Effort::Quick { 2 } else { 10 };
    let mut method = Method::ours().with(effort);
    // Of the joint solve, to the full resolution.
    method.config.solver.free_form = FreeForm::None;
    let start = subject.start(jobs, effort)?.short;
    let optimum = subject.runs(jobs, &[(method.clone(), start)])?.remove(0).joint;
    let figures = jobs.run(
        &[()],
        |()| format!("{}/surface", subject.name),
        |()| Ok(json!([subject.digest(), method.config, optimum, half])),
        |(), _| scan(subject, &method, &optimum, half),
    )?;
    figures.into_iter().next().ok_or(StudyError::Interrupted)
}

fn scan(subject: &Subject, method: &Method, optimum: &Estimate, half: i32) -> Result<Fig3, StudyError> {
    let failed = |source| StudyError::Objective {
        name: subject.name.clone(),
        source,
    };
    let target = subject.sequence.frames.len() / 2;
    let prior: Arc<dyn ShapePrior> = Arc::new(prior::find(&method.config.prior)?);
    let footage = Footage::new(&subject.sequence, 1).map_err(failed)?;
    let mut objective =
        Objective::new(&footage, prior, &method.config.objective, target, optimum, 1).map_err(failed)?;
    let angles_deg: Vec<f64> = (-half..=half)
        .map(|i| REACH_DEG * f64::from(i) / f64::from(half))
        .collect();
    let turned = |angle_deg: f64| Pose {
        rotation: optimum.camera_from_object[target].rotation
            * Rotation3::from_axis_angle(&Vector3::y_axis(), angle_deg.to_radians()),
        translation: optimum.camera_from_object[target].translation,
    };
    let mut cost = |estimate: &Estimate| -> Result<(f64, f64), ObjectiveError> {
        let visibility = objective.visibility(estimate, 0)?;
        let value = objective.evaluate(estimate, &visibility)?;
        Ok((value.photometric, value.total))
    };
    // The optimum's own cameras as if they were an off-the-shelf reconstruction: Eq. 13 then keeps their relative motion.
    let cameras = &optimum.camera_from_object;
    let sources: Vec<usize> = (0..cameras.len()).filter(|&l| l != target).collect();
    let (mut surface, mut correct_motion, mut no_motion) = (Vec::new(), Vec::new(), Vec::new());
    for &angle in &angles_deg {
        let target_from_object = turned(angle);
        let followed = Estimate {
            camera_from_object: cameras_from_input(&target_from_object, target, cameras, 1.0),
            ..optimum.clone()
        };
        correct_motion.push(cost(&followed).map_err(failed)?.1);
        let still = Estimate {
            camera_from_object: vec![target_from_object; cameras.len()],
            ..followed.clone()
        };
        no_motion.push(cost(&still).map_err(failed)?.1);
        let row = angles_deg.iter().map(|&more| {
            let mut moved = followed.clone();
            for (i, &l) in sources.iter().enumerate() {
                // About the object's vertical axis: Δω_l after it is what turns.
                let share = (i + 1) as f64 / sources.len() as f64;
                let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), (share * more).to_radians());
                moved.camera_from_object[l].rotation *= turn;
            }
            Ok(cost(&moved)?.0)
        });
        surface.push(row.collect::<Result<_, _>>().map_err(failed)?);
    }
    Ok(Fig3 {
        angles_deg,
        surface,
        correct_motion,
        no_motion,
    })
}

impl Fig3 {
    /// One line per point of the surface.
    pub fn table(&self) -> Table {
        let mut table = Table::new(&[
            "p0_deg",
            "motion_deg",
            "photometric_cost",
            "objective_correct_motion",
            "objective_no_motion",
        ]);
        for (i, row) in self.surface.iter().enumerate() {
            for (j, &value) in row.iter().enumerate() {
                table.rows.push(vec![
                    format!("{}", self.angles_deg[i]),
                    format!("{}", self.angles_deg[j]),
                    cell(Some(value), 3),
                    cell(self.correct_motion.get(i).copied(), 3),
                    cell(self.no_motion.get(i).copied(), 3),
                ]);
            }
        }
        table
    }

    /// `fig3-surface.svg` and `fig3-slices.svg`.
    pub fn draw(&self, folder: &Path) -> Result<(), StudyError> {
        Heat {
            title: "Photometric cost over p0 and the motion (line: the correct motion)",
            x: Axis::linear("p0 turned by, degrees"),
            y: Axis::linear("motion turned on by, degrees"),
            at: &self.angles_deg,
            values: &self.surface,
        }
        .write(&folder.join("fig3-surface.svg"))?;
        let line = |label: &str, values: &[f64]| Line {
            label: label.to_owned(),
            points: self
                .angles_deg
                .iter()
                .copied()
                .zip(values.iter().copied())
                .collect(),
            joined: true,
        };
        Chart {
            title: "The objective along p0",
            x: Axis::linear("p0 turned by, degrees"),
            y: Axis::logarithmic("objective"),
            lines: vec![
                line("with the correct motion (Eq. 13)", &self.correct_motion),
                line("without motion", &self.no_motion),
            ],
        }
        .write(&folder.join("fig3-slices.svg"))
    }
}
