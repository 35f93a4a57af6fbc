//! Algorithm 1, the joint solve, the scale α (Eq. 8), stopping, and progress events.

mod descent;
mod deviations;
mod options;
mod progress;
mod scale;
mod solution;

pub use deviations::{CameraDeviation, Deviations};
pub use options::{
    Evaluation, Interpolation, LinearSolver, Minimiser, MotionStart, SolverOptions, Strategy,
    default_lbfgs_rank, default_trust_region_radius,
};
pub use progress::Observer;
pub use scale::{ScaleUpdate, scale_from_motion};
pub use solution::{
    Evaluations, HypothesisOutcome, ObjectiveValue, Solution, StepState, Termination, TraceRow,
};

use crate::init::{Estimate, Initialisation};
use crate::objective::{Footage, Objective, ObjectiveError, ObjectiveOptions, Pairs};
use crate::prior::{InvalidPrior, ShapePrior};
use descent::{Descent, Route, descend};
use progress::Progress;
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

/// Steps of the free form's stage and Ceres iterations of each, at most: on the bundled sequence, the first ten iterations bring 93 % of what 65
/// do.
const FREE_STEPS: usize = 2;
const FREE_ITERATIONS: u32 = 10;

/// Why there is no solution.
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    /// An option is out of range. The fields are its key and what to give instead.
    #[error("option {0}: {1}")]
    Option(&'static str, &'static str),
    /// The initialisation gave no starting point.
    #[error("no start: the initialisation found no pose")]
    NoStart,
    /// The objective cannot be built or evaluated.
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
    /// The shape with the free form is no prior.
    #[error("the prior's free form: {0}")]
    Prior(#[from] InvalidPrior),
}

/// Minimises Eq. 9 over a sequence: [`short_solves`], then [`refine`] from the best of them, then, where the prior has a free form,
/// [`free`]. Where the shape itself tells its canonical frame ([`ShapePrior::canonical_from_shape`]), the result is in that. `target` is the paper's target
/// frame, the one that the starts' p0 is of.
///
/// `observer` sees every Ceres iteration and returns false to stop there; the best state so far is then the
/// solution.
///
/// # Errors
/// Options out of range, no start, or a failing objective.
pub fn solve(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    starts: &[Initialisation],
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    observer: &Observer,
) -> Result<Solution, SolveError> {
    check(options)?;
    let estimates: Vec<Estimate> = starts.iter().map(|start| start.estimate.clone()).collect();
    let short = short_solves(
        footage,
        prior,
        target,
        &estimates,
        objective_options,
        options.evaluation,
        observer,
    )?;
    let hypotheses = starts
        .iter()
        .zip(&short.objectives)
        .enumerate()
        .map(
            |(i, (start, &(objective_start, objective_end)))| HypothesisOutcome {
                azimuth_deg: start.hypothesis.azimuth_deg,
                elevation_deg: start.hypothesis.elevation_deg,
                roll_deg: start.hypothesis.roll_deg,
                template_iou: start.hypothesis.iou,
                objective_start,
                objective_end,
                chosen: i == short.chosen,
            },
        )
        // Without those whose turn did not come.
        .filter(|outcome: &HypothesisOutcome| outcome.objective_end.is_finite())
        .collect();
    tracing::info!(
        "start {} of {} is the best: objective {:.1}",
        short.chosen,
        starts.len(),
        short.objectives[short.chosen].1
    );
    let go_on_from = if short.interrupted { unrefined } else { refine };
    let refined = go_on_from(
        footage,
        prior,
        target,
        &short.estimate,
        objective_options,
        options,
        observer,
    )?;
    tracing::info!(
        "objective {:.1} -> {:.1} in {} iterations",
        refined.objective_start.total,
        refined.objective_end.total,
        refined.iterations
    );
    let found = complete(
        footage,
        prior,
        target,
        refined,
        objective_options,
        options,
        observer,
    )?;
    Ok(Solution {
        hypotheses,
        trace: short.trace.into_iter().chain(found.trace).collect(),
        seconds: short.seconds.into_iter().chain(found.seconds).collect(),
        ..found
    })
}

/// What [`refine`] found, bent by the free form where the prior and the options have one, and moved from the prior's frame to the
/// canonical frame of the shape itself ([`ShapePrior::canonical_from_shape`]).
///
/// # Errors
/// Options out of range, or a failing objective.
pub fn complete(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    refined: Solution,
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    observer: &Observer,
) -> Result<Solution, SolveError> {
    let freed = prior.freed(options.free_form)?;
    let found = match freed {
        _ if refined.termination == Termination::Interrupted => refined,
        Some(freed) => free(
            footage,
            (prior, &freed),
            target,
            refined,
            objective_options,
            options,
            observer,
        )?,
        None => judged(footage, prior, target, refined, objective_options, options)?,
    };
    let canonical_from_shape = prior.canonical_from_shape(&found.estimate.style, &found.free_form);
    Ok(Solution {
        estimate: match &canonical_from_shape {
            Some(canonical_from_shape) => found.estimate.in_frame(canonical_from_shape),
            None => found.estimate,
        },
        canonical_from_shape,
        ..found
    })
}

/// Goes on from `solution` with a prior that has a free form, too ([`ShapePrior::freed`]): poses, style and form move together, at full
/// resolution. The trace's stage is `free-form`.
fn free(
    footage: &Footage,
    (prior, freed): (&Arc<dyn ShapePrior>, &Arc<dyn ShapePrior>),
    target: usize,
    solution: Solution,
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    observer: &Observer,
) -> Result<Solution, SolveError> {
    check(options)?;
    let began = Instant::now();
    let styles = solution.estimate.style.len();
    let mut start = solution.estimate.clone();
    start.style.resize(freed.style_len(), 0.0);
    let mut objective = Objective::new(
        footage,
        freed.clone(),
        objective_options,
        target,
        &start,
        options.threads,
    )?;
    let route = Route {
        stage: "free-form/",
        placing_steps: 0,
        levels: &[0],
    };
    let options = SolverOptions {
        max_steps: options.max_steps.min(FREE_STEPS),
        iterations_per_call: options.iterations_per_call.min(FREE_ITERATIONS),
        ..options.clone()
    };
    let descent = descend(
        &mut objective,
        footage.sequence(),
        target,
        &start,
        &options,
        &route,
        &mut Progress::new(observer),
    )?;
    let mut estimate = descent.estimate;
    let deviations = match descent.termination {
        Termination::Interrupted => None,
        _ => Deviations::at(
            &mut objective,
            prior.as_ref(),
            &estimate,
            styles,
            objective_options.style_weight,
        )?,
    };
    let free_form = estimate.style.split_off(styles.min(estimate.style.len()));
    let seconds = [
        ("free_form".to_owned(), began.elapsed().as_secs_f64()),
        ("free_form_cpu".to_owned(), descent.cpu_seconds),
    ];
    Ok(Solution {
        estimate,
        free_form,
        deviations,
        objective_end: descent.end,
        evaluations: solution.evaluations.plus(descent.evaluations),
        iterations: solution.iterations + descent.iterations,
        termination: descent.termination,
        trace: solution.trace.into_iter().chain(descent.trace).collect(),
        seconds: solution.seconds.into_iter().chain(seconds).collect(),
        ..solution
    })
}

/// `solution`, which has no free form, with its deviations.
fn judged(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    solution: Solution,
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
) -> Result<Solution, SolveError> {
    let found = &solution.estimate;
    let (styles, weight) = (found.style.len(), objective_options.style_weight);
    let mut objective = Objective::new(
        footage,
        prior.clone(),
        objective_options,
        target,
        found,
        options.threads,
    )?;
    let deviations = Deviations::at(&mut objective, prior.as_ref(), found, styles, weight)?;
    Ok(Solution {
        deviations,
        ..solution
    })
}

fn check(options: &SolverOptions) -> Result<(), SolveError> {
    options
        .check()
        .map_err(|(name, why)| SolveError::Option(name, why))
}

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
            let route = Route {
                stage: &format!("hypothesis-{}/round-{round}/", trial.index),
                placing_steps: if round == 0 { PLACING_STEPS } else { 0 },
                levels: &[footage.levels() - 1],
            };
            let descent = descend(
                &mut objective,
                footage.sequence(),
                target,
                &trial.estimate,
                &options,
                &route,
                &mut Progress::new(&observer),
            )?;
            trial.take(descent, round == 0);
            Ok::<_, SolveError>(())
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
    fn take(&mut self, descent: Descent, is_first: bool) {
        if is_first {
            self.objectives.0 = descent.start.total;
        }
        self.objectives.1 = descent.end.total;
        self.estimate = descent.estimate;
        self.trace.extend(descent.trace);
        self.cpu_seconds += descent.cpu_seconds;
    }
}

/// A start as the solution, with its objective: what there is once the observer has stopped the short solves.
fn unrefined(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    start: &Estimate,
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    _: &Observer,
) -> Result<Solution, SolveError> {
    let mut objective = Objective::new(
        footage,
        prior.clone(),
        objective_options,
        target,
        start,
        options.threads,
    )?;
    let visibility = objective.visibility(start, 0)?;
    let objective = objective.evaluate(start, &visibility)?;
    Ok(Solution {
        estimate: start.clone(),
        free_form: Vec::new(),
        deviations: None,
        canonical_from_shape: None,
        objective_start: objective,
        objective_end: objective,
        evaluations: Evaluations::default(),
        iterations: 0,
        termination: Termination::Interrupted,
        hypotheses: Vec::new(),
        steps: Vec::new(),
        trace: Vec::new(),
        seconds: Vec::new(),
    })
}

/// Minimises Eq. 9 from one start, through the pyramid levels of `footage` from the coarsest on, at most `options.levels`. The solution is
/// in the prior's frame, without free form; [`complete`] goes on from it.
///
/// # Errors
/// Options out of range, or a failing objective.
pub fn refine(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    start: &Estimate,
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    observer: &Observer,
) -> Result<Solution, SolveError> {
    check(options)?;
    if options.minimiser.eliminates_poses() && objective_options.pairs != Pairs::Star {
        return Err(SolveError::Option(
            "linear_solver",
            "a Schur solver needs objective.pairs = \"star\": the poses that it eliminates may share no residual",
        ));
    }
    let began = Instant::now();
    let mut start = start.clone();
    if options.motion_start == MotionStart::Zero
        && let Some(&of_target) = start.camera_from_object.get(target)
    {
        start.camera_from_object.fill(of_target);
    }
    let mut objective = Objective::new(
        footage,
        prior.clone(),
        objective_options,
        target,
        &start,
        options.threads,
    )?;
    let levels: Vec<usize> = (0..options.levels.min(footage.levels())).rev().collect();
    let route = Route {
        stage: "",
        placing_steps: 0,
        levels: &levels,
    };
    let descent = descend(
        &mut objective,
        footage.sequence(),
        target,
        &start,
        options,
        &route,
        &mut Progress::new(observer),
    )?;
    Ok(Solution {
        estimate: descent.estimate,
        free_form: Vec::new(),
        deviations: None,
        canonical_from_shape: None,
        objective_start: descent.start,
        objective_end: descent.end,
        evaluations: descent.evaluations,
        iterations: descent.iterations,
        termination: descent.termination,
        hypotheses: Vec::new(),
        steps: descent.steps,
        trace: descent.trace,
        seconds: vec![
            ("solve".to_owned(), began.elapsed().as_secs_f64()),
            ("solve_cpu".to_owned(), descent.cpu_seconds),
        ],
    })
}
