//! Algorithm 1, the joint solve, the scale α (Eq. 8), stopping, and progress events.

mod descent;
mod options;
mod progress;
mod scale;
mod solution;

pub use options::{Minimiser, SolverOptions, Strategy, default_lbfgs_rank, default_trust_region_radius};
pub use progress::Observer;
pub use scale::{ScaleUpdate, scale_from_motion};
pub use solution::{Evaluations, HypothesisOutcome, ObjectiveValue, Solution, Termination, TraceRow};

use crate::geometry::Pose;
use crate::init::{Estimate, Initialisation};
use crate::objective::{Objective, ObjectiveError, ObjectiveOptions};
use crate::prior::ShapePrior;
use crate::sequence::Sequence;
use cpu_time::ProcessTime;
use descent::{Descent, Route, descend};
use progress::Progress;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// A hypothesis is judged with this many of the prior's points.
const HYPOTHESIS_POINTS: usize = 2048;
/// So many steps of a short solve move the pose alone.
const PLACING_STEPS: usize = 3;

/// Why there is no solution.
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    #[error("option {0}: {1}")]
    Option(&'static str, &'static str),
    #[error("no start: the initialisation found no pose")]
    NoStart,
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
}

/// Minimises Eq. 9 over a sequence: a short solve from every start at the coarsest pyramid level, then from
/// the best of them through all levels. The short solves take none of the options given: they are part of the start,
/// which is the same for all methods and weights.
///
/// `observer` sees every Ceres iteration and returns false to stop there; the best state so far is then the
/// solution. Starts are solved side by side on rayon's threads, each in itself on one thread, so that the
/// result does not depend on how many there are.
///
/// # Errors
/// Options out of range, no start, or a failing objective.
pub fn solve(
    sequence: &Sequence,
    prior: &Arc<dyn ShapePrior>,
    starts: &[Initialisation],
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    observer: &Observer,
) -> Result<Solution, SolveError> {
    options
        .check()
        .map_err(|(name, why)| SolveError::Option(name, why))?;
    let camera_from_input: Vec<Option<Pose>> = sequence.frames.iter().map(|f| f.camera_from_input).collect();
    let began = Instant::now();
    let cpu_began = cpu_seconds();
    let run = |start: &Estimate, weights: &ObjectiveOptions, options: &SolverOptions, route: &Route| {
        let mut objective = Objective::new(sequence, prior.clone(), weights, options.levels, start)?;
        let mut progress = Progress::new(observer, began);
        let descent = descend(&mut objective, &camera_from_input, options, route, &mut progress)?;
        Ok::<_, ObjectiveError>((descent, progress.into_trace()))
    };

    let short = SolverOptions {
        max_steps: 5,
        iterations_per_call: 10,
        ..SolverOptions::default()
    };
    let cautious = ObjectiveOptions::default().cautious(HYPOTHESIS_POINTS, prior.point_count());
    let trials: Vec<(Descent, Vec<TraceRow>)> = starts
        .par_iter()
        .enumerate()
        .map(|(i, start)| {
            run(
                &start.estimate,
                &cautious,
                &short,
                &Route {
                    stage: &format!("hypothesis-{i}/"),
                    placing_steps: PLACING_STEPS,
                    levels: &[short.levels - 1],
                },
            )
        })
        .collect::<Result<_, _>>()?;
    let chosen = best_trial(&trials).ok_or(SolveError::NoStart)?;
    let hypotheses_seconds = began.elapsed().as_secs_f64();
    let hypotheses_cpu = cpu_seconds();

    let levels: Vec<usize> = (0..options.levels).rev().collect();
    let (descent, trace) = run(
        &trials[chosen].0.estimate,
        objective_options,
        options,
        &Route {
            stage: "",
            placing_steps: 0,
            levels: &levels,
        },
    )?;
    let hypotheses = starts
        .iter()
        .zip(&trials)
        .enumerate()
        .map(|(i, (start, (trial, _)))| HypothesisOutcome {
            azimuth_deg: start.hypothesis.azimuth_deg,
            elevation_deg: start.hypothesis.elevation_deg,
            roll_deg: start.hypothesis.roll_deg,
            template_iou: start.hypothesis.iou,
            objective_start: trial.start.total,
            objective_end: trial.end.total,
            chosen: i == chosen,
        })
        .collect();
    Ok(Solution {
        estimate: descent.estimate,
        objective_start: descent.start,
        objective_end: descent.end,
        evaluations: descent.evaluations,
        iterations: descent.iterations,
        termination: descent.termination,
        hypotheses,
        trace: trials
            .into_iter()
            .flat_map(|(_, trace)| trace)
            .chain(trace)
            .collect(),
        seconds: vec![
            ("hypotheses".to_owned(), hypotheses_seconds),
            (
                "solve".to_owned(),
                began.elapsed().as_secs_f64() - hypotheses_seconds,
            ),
            ("hypotheses_cpu".to_owned(), hypotheses_cpu - cpu_began),
            ("solve_cpu".to_owned(), cpu_seconds() - hypotheses_cpu),
        ],
    })
}

/// Processor time of the whole process so far.
fn cpu_seconds() -> f64 {
    ProcessTime::now().as_duration().as_secs_f64()
}

/// The index of the lowest objective.
fn best_trial(trials: &[(Descent, Vec<TraceRow>)]) -> Option<usize> {
    (0..trials.len()).min_by(|&a, &b| trials[a].0.end.total.total_cmp(&trials[b].0.end.total))
}
