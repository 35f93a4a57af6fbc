//! Minimisers and strategies on one objective from the same starts.
//!
//! Iterations of different minimisers mean different things, and each sees its own visibility while a call runs. So every
//! state at the end of a call is judged by one referee: the objective at full resolution with the visibility of that
//! state. The judged objective is what tables and charts show, against iterations, evaluations and processor seconds.

mod charts;
mod settings;
mod tables;

pub use settings::{MinimiserSettings, Perturbation, SettingsError};

use super::measures::mean;
use super::subject::prior_digest;
use super::{Effort, Jobs, Measures, Method, StudyError, Subject, perturbed_pose};
use crate::config::Config;
use crate::eval::{location_error, orientation_error_deg};
use crate::init::{Estimate, cameras_from_input};
use crate::objective::Objective;
use crate::prior::{self, ShapePrior};
use crate::report::Surface;
use crate::sequence::Sequence;
use crate::solver::{self, Solution, Termination, TraceRow};
use cpu_time::ThreadTime;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::sync::{Arc, Mutex, PoisonError};

/// The share of the best objective within which a minimiser has reached it.
const REACHED: f64 = 0.01;

/// The start, or the state after a solver call, judged by the referee.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JudgedState {
    /// Pyramid level of the call, 0 is the finest; none at the start.
    pub level: Option<usize>,
    /// At full resolution, with the visibility of the state itself.
    pub objective: f64,
    /// Since the start.
    pub iterations: usize,
    /// Since the start, residual and Jacobian evaluations together.
    pub evaluations: usize,
    /// Since the start.
    pub cpu_seconds: f64,
    /// Mean over the frames, where the truth is known.
    pub rotation_error_deg: Option<f64>,
    /// Mean over the frames, where the truth is known; % of the object's diagonal.
    pub location_error_percent: Option<f64>,
}

/// A solver iteration as the minimiser saw it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Iteration {
    /// Index in [`Minimisation::states`] of the state that its call ends with.
    pub call: usize,
    /// Pyramid level, 0 is the finest.
    pub level: usize,
    /// Which variables moved: `all`, `p0`, `motion`, `style`.
    pub block: String,
    /// Since the start. A call's first line has the count of the line before: it is the state that the call begins with.
    pub iterations: usize,
    /// Since the start, residual and Jacobian evaluations together.
    pub evaluations: usize,
    /// At the call's pyramid level, with the visibility that the call began with: comparable within a call alone.
    pub objective: f64,
    /// Since the start.
    pub cpu_seconds: f64,
}

/// One minimiser from one start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Minimisation {
    /// Its name in the settings.
    pub minimiser: String,
    /// Which start.
    pub seed: u64,
    /// The start, and the state after every solver call.
    pub states: Vec<JudgedState>,
    /// All iterations of all calls.
    pub iterations: Vec<Iteration>,
    /// Why it ended.
    pub termination: Termination,
    /// Of the last state.
    pub measures: Measures,
}

/// All minimisers from all starts.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The sequence's name.
    pub sequence: String,
    /// How many of its frames are in use.
    pub frames: usize,
    /// How far the starts are apart.
    pub perturbation: Perturbation,
    /// Indexed by seed.
    pub starts: Vec<Estimate>,
    /// In the settings' order.
    pub minimisers: Vec<Method>,
    /// Seed by seed, in the minimisers' order.
    pub minimisations: Vec<Minimisation>,
}

/// Runs what is missing: every minimiser from every start. The start of seed 0 is the best of the short solves; those of
/// seeds 1 to `seeds` − 1 are perturbed from it.
///
/// # Errors
/// What a solve or the start fails with, or an interruption. Minimisations that are done by then are kept.
pub fn compare(
    subject: &Subject,
    settings: &MinimiserSettings,
    seeds: u64,
    jobs: &Jobs,
    effort: Effort,
) -> Result<Comparison, StudyError> {
    let start = subject
        .start_by(settings.prior.clone(), settings.init.clone(), jobs, effort)?
        .short;
    let target = subject.sequence.frames.len() / 2;
    let starts: Vec<Estimate> = (0..seeds)
        .map(|seed| perturbed(&start, target, &settings.perturbation, seed))
        .collect();
    let minimisers: Vec<Method> = settings
        .methods
        .iter()
        .map(|method| method.clone().with(effort))
        .collect();
    let runs: Vec<(&Method, u64, &Estimate)> = (0..)
        .zip(&starts)
        .flat_map(|(seed, start)| minimisers.iter().map(move |method| (method, seed, start)))
        .collect();
    let prior = prior_digest(&settings.prior);
    let minimisations = jobs.run(
        &runs,
        |(method, seed, _)| format!("{}/compare-{}-{seed}", subject.name, method.name),
        |(method, _, start)| Ok(json!([subject.digest(), method.config, prior, start])),
        |&(method, seed, start), observer| minimise(subject, target, method, start, seed, observer),
    )?;
    Ok(Comparison {
        sequence: subject.name.clone(),
        frames: subject.sequence.frames.len(),
        perturbation: settings.perturbation,
        starts,
        minimisers,
        minimisations,
    })
}

/// The start of a seed. Relative motion (Eq. 13), style and α stay.
fn perturbed(start: &Estimate, target: usize, by: &Perturbation, seed: u64) -> Estimate {
    if seed == 0 {
        return start.clone();
    }
    let cameras = &start.camera_from_object;
    let target_from_object = perturbed_pose(&cameras[target], by.rotation_deg, by.share_of_distance, seed);
    Estimate {
        camera_from_object: cameras_from_input(&target_from_object, target, cameras, 1.0),
        ..start.clone()
    }
}

fn minimise(
    subject: &Subject,
    target: usize,
    method: &Method,
    start: &Estimate,
    seed: u64,
    observer: &solver::Observer,
) -> Result<Minimisation, StudyError> {
    let name = || format!("{}/{}", subject.name, method.name);
    let Config {
        objective, solver, ..
    } = &method.config;
    let learned = prior::find(&method.config.prior)?;
    let prior: Arc<dyn ShapePrior> = Arc::new(learned.clone());
    let footage = subject.footage(solver.levels)?;
    let seen = Mutex::new(Vec::new());
    let clocked = |row: &TraceRow| {
        // The solve is on this thread alone, so that its clock is the solve's.
        let now = ThreadTime::now().as_duration().as_secs_f64();
        seen.lock().unwrap_or_else(PoisonError::into_inner).push(now);
        observer(row)
    };
    let solution = solver::refine(&footage, &prior, target, start, objective, solver, &clocked)
        .map_err(|source| StudyError::Solve { name: name(), source })?;
    let ended = ThreadTime::now().as_duration().as_secs_f64();
    if solution.termination == Termination::Interrupted {
        return Err(StudyError::Interrupted);
    }
    let failed = |source| StudyError::Objective { name: name(), source };
    let mut referee = Objective::new(&footage, prior, objective, target, start, 1).map_err(failed)?;
    let mut judge = |estimate: &Estimate| {
        let visibility = referee.visibility(estimate, 0)?;
        let canonical = Surface::of_estimate(&learned, estimate).1;
        let [rotation_error_deg, location_error_percent] = camera_errors(&subject.sequence, &canonical);
        Ok(JudgedState {
            level: None,
            objective: referee.evaluate(estimate, &visibility)?.total,
            iterations: 0,
            evaluations: 0,
            cpu_seconds: 0.0,
            rotation_error_deg,
            location_error_percent,
        })
    };
    let mut states = vec![judge(start).map_err(failed)?];
    for step in &solution.steps {
        states.push(JudgedState {
            level: Some(step.level),
            iterations: step.iterations,
            evaluations: step.evaluations.residual + step.evaluations.jacobian,
            cpu_seconds: step.cpu_seconds,
            ..judge(&step.estimate).map_err(failed)?
        });
    }
    let seen = seen.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(Minimisation {
        minimiser: method.name.clone(),
        seed,
        iterations: iterations(&solution, &states, &seen, ended),
        states,
        termination: solution.termination,
        measures: subject.measure(&learned, &solution.estimate),
    })
}

/// The solution's trace beside its `states`. `seen` has the thread's processor time at each line, `ended` that after the solve.
fn iterations(solution: &Solution, states: &[JudgedState], seen: &[f64], ended: f64) -> Vec<Iteration> {
    // The descent's own clock began when the thread's stood at this.
    let descent = solution.seconds.iter().find(|(stage, _)| stage == "solve_cpu");
    let began = ended - descent.map_or(0.0, |(_, seconds)| *seconds);
    let mut iterations = Vec::new();
    for (row, seen) in solution.trace.iter().zip(seen) {
        let evaluations = row.residual_evaluations + row.jacobian_evaluations;
        // A call that moved nothing has no line, and the count of the one before.
        let call = states.partition_point(|state| state.evaluations < evaluations);
        iterations.push(Iteration {
            call,
            level: states.get(call).and_then(|state| state.level).unwrap_or(0),
            block: row.block.clone(),
            iterations: states[..call].last().map_or(0, |state| state.iterations) + row.iteration,
            evaluations,
            objective: row.objective.total,
            cpu_seconds: (seen - began).max(0.0),
        });
    }
    iterations
}

/// Mean rotation error in degrees and location error in % of the diagonal.
fn camera_errors(sequence: &Sequence, estimate: &Estimate) -> [Option<f64>; 2] {
    let Some(truth) = &sequence.truth else {
        return [None, None];
    };
    let poses = || truth.camera_from_object.iter().enumerate();
    let rotation = poses()
        .map(|(l, pose)| orientation_error_deg(&estimate.camera_from_object[l].rotation, &pose.rotation));
    let location = poses().map(|(l, pose)| 100.0 * location_error(&estimate.camera_from_object[l], pose));
    [mean(rotation), mean(location)]
}

impl Comparison {
    /// The least objective that any minimiser found from a seed's start.
    fn best(&self, seed: u64) -> f64 {
        let states = self
            .minimisations
            .iter()
            .filter(|minimisation| minimisation.seed == seed)
            .flat_map(|minimisation| &minimisation.states);
        states.map(|state| state.objective).fold(f64::INFINITY, f64::min)
    }

    /// The first state within [`REACHED`] of the best objective from its start.
    fn reached<'a>(&self, minimisation: &'a Minimisation) -> Option<&'a JudgedState> {
        let bound = (1.0 + REACHED) * self.best(minimisation.seed);
        minimisation.states.iter().find(|state| state.objective <= bound)
    }

    /// What there is of a minimiser, seed by seed.
    fn of(&self, minimiser: &str) -> Vec<&Minimisation> {
        self.minimisations
            .iter()
            .filter(|minimisation| minimisation.minimiser == minimiser)
            .collect()
    }
}

impl Minimisation {
    /// The last state; the start where no call was made.
    fn last(&self) -> &JudgedState {
        // There is always the start.
        &self.states[self.states.len() - 1]
    }
}

#[cfg(test)]
mod tests;
