//! Short solves from every start, of which the best goes on.

use super::descent::{Route, descend};
use super::progress::{Observer, Progress};
use super::{Evaluation, SolveError, SolverOptions, TraceRow};
use crate::init::Estimate;
use crate::objective::{Footage, Objective, ObjectiveOptions};
use crate::prior::ShapePrior;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A hypothesis is judged with this many of the prior's points.
const HYPOTHESIS_POINTS: usize = 2048;
/// So many steps of a short solve move the pose alone.
const PLACING_STEPS: usize = 3;
/// Steps of a short solve that move all variables, round by round.
const SHORT_SOLVE_STEPS: [usize; 3] = [1, 1, 3];
/// Ceres iterations of each of them.
const SHORT_SOLVE_ITERATIONS: u32 = 10;
/// [`SolverOptions::tolerance`] of a short solve.
const SHORT_SOLVE_TOLERANCE: f64 = 3e-3;

/// The best of the short solves.
#[derive(Clone, Debug)]
pub struct ShortSolves {
    /// The variables after the best short solve.
    pub estimate: Estimate,
    /// The index of its start.
    pub chosen: usize,
    /// By the observer; the starts that had not had their turn have an infinite objective.
    pub interrupted: bool,
    /// Per start: the objective before and after, comparable among them alone.
    pub objectives: Vec<(f64, f64)>,
    /// The iterations of all short solves.
    pub trace: Vec<TraceRow>,
    /// Stage name → seconds, as in [`Solution::seconds`].
    pub seconds: Vec<(String, f64)>,
}

/// A short solve from every start, at the coarsest pyramid level of `footage`, all variables at once by Levenberg–Marquardt;
/// the lowest objective wins. The objective is `objective_options`', made cautious for starts that may be far off. After each
/// round the worse half of the starts is given up.
///
/// They run side by side on rayon's threads, each in itself on one thread, so that the result does not depend on how
/// many there are.
///
/// # Errors
/// No start, or a failing objective.
pub fn short_solves(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    starts: &[Estimate],
    objective_options: &ObjectiveOptions,
    evaluation: Evaluation,
    observer: &Observer,
) -> Result<ShortSolves, SolveError> {
    let began = Instant::now();
    let cautious = objective_options.cautious(HYPOTHESIS_POINTS, prior.point_count());
    let mut trials: Vec<Trial> = starts
        .iter()
        .enumerate()
        .map(|(index, start)| Trial {
            index,
            estimate: start.clone(),
            objectives: (f64::INFINITY, f64::INFINITY),
            trace: Vec::new(),
            cpu_seconds: 0.0,
        })
        .collect();
    let mut given_up = Vec::new();
    let stopped = AtomicBool::new(false);
    let observer = |row: &TraceRow| {
        let goes_on = observer(row);
        stopped.fetch_or(!goes_on, Ordering::Relaxed);
        goes_on
    };
    for (round, &steps) in SHORT_SOLVE_STEPS.iter().enumerate() {
        let options = SolverOptions {
            evaluation,
            max_steps: steps,
            iterations_per_call: SHORT_SOLVE_ITERATIONS,
            tolerance: SHORT_SOLVE_TOLERANCE,
            ..SolverOptions::default()
        };
        trials.par_iter_mut().try_for_each(|trial| {
            if stopped.load(Ordering::Relaxed) {
                return Ok(());
            }
            let start = &starts[trial.index];
            let mut objective = Objective::new(footage, prior.clone(), &cautious, target, start, 1)?;
            trial.go_on(&mut objective, footage, target, round, &options, &observer)
        })?;
        tracing::debug!("round {round}: {} starts solved", trials.len());
        // Stable, so that ties keep the order of the starts.
        trials.sort_by(|a, b| a.objectives.1.total_cmp(&b.objectives.1));
        let kept = trials.len().div_ceil(2);
        if round + 1 < SHORT_SOLVE_STEPS.len() {
            given_up.extend(trials.drain(kept..));
        }
        if stopped.load(Ordering::Relaxed) {
            break;
        }
    }
    let best = trials.first().ok_or(SolveError::NoStart)?;
    let (estimate, chosen) = (best.estimate.clone(), best.index);
    trials.extend(given_up);
    trials.sort_by_key(|trial| trial.index);
    Ok(ShortSolves {
        estimate,
        chosen,
        interrupted: stopped.into_inner(),
        objectives: trials.iter().map(|trial| trial.objectives).collect(),
        seconds: vec![
            ("hypotheses".to_owned(), began.elapsed().as_secs_f64()),
            (
                "hypotheses_cpu".to_owned(),
                trials.iter().map(|trial| trial.cpu_seconds).sum(),
            ),
        ],
        trace: trials.into_iter().flat_map(|trial| trial.trace).collect(),
    })
}

/// A start on its way through the rounds of [`short_solves`].
struct Trial {
    /// The index of the start.
    index: usize,
    estimate: Estimate,
    /// At the start and now.
    objectives: (f64, f64),
    trace: Vec<TraceRow>,
    cpu_seconds: f64,
}

impl Trial {
    /// One round of it.
    fn go_on(
        &mut self,
        objective: &mut Objective,
        footage: &Footage,
        target: usize,
        round: usize,
        options: &SolverOptions,
        observer: &Observer,
    ) -> Result<(), SolveError> {
        let route = Route {
            stage: &format!("hypothesis-{}/round-{round}/", self.index),
            placing_steps: if round == 0 { PLACING_STEPS } else { 0 },
            levels: &[footage.levels() - 1],
        };
        let descent = descend(
            objective,
            footage.sequence(),
            target,
            &self.estimate,
            options,
            &route,
            &mut Progress::new(observer),
        )?;
        if round == 0 {
            self.objectives.0 = descent.start.total;
        }
        self.objectives.1 = descent.end.total;
        self.estimate = descent.estimate;
        self.trace.extend(descent.trace);
        self.cpu_seconds += descent.cpu_seconds;
        Ok(())
    }
}
