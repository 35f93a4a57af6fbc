//! Algorithm 1, the joint solve, the scale α (Eq. 8), stopping, and progress events.

mod descent;
mod deviations;
mod options;
mod progress;
mod scale;
mod short;
mod solution;

pub use deviations::{CameraDeviation, Deviations};
pub use options::{
    Evaluation, Interpolation, LinearSolver, Minimiser, MotionStart, SolverOptions, Strategy,
    default_lbfgs_rank, default_trust_region_radius,
};
pub use progress::Observer;
pub use scale::{ScaleUpdate, scale_from_motion};
pub use short::{ShortSolves, short_solves};
pub use solution::{
    Evaluations, HypothesisOutcome, ObjectiveValue, Solution, StepState, Termination, TraceRow,
};

use crate::init::{Estimate, Initialisation};
use crate::objective::{Footage, Objective, ObjectiveError, ObjectiveOptions, Pairs};
use crate::prior::{InvalidPrior, ShapePrior};
use descent::{Route, descend, judge};
use progress::Progress;
use std::sync::Arc;
use std::time::Instant;

/// Steps of the free form's stage, at most.
const FREE_STEPS: usize = 4;

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

/// A prior that competes with others, and where it starts.
pub struct Candidate<'a> {
    /// The prior.
    pub prior: &'a Arc<dyn ShapePrior>,
    /// Its starts.
    pub starts: &'a [Initialisation],
}

/// The lowest objective of each candidate's [`short_solves`], of which the lowest of all says which prior fits. Where a category has
/// several templates, each is a prior; all are standard normal, so that what a style costs is alike. Once `observer` has stopped them,
/// the candidates that had no turn have an infinite objective.
///
/// # Errors
/// No start, or a failing objective.
pub fn compete(
    footage: &Footage,
    candidates: &[Candidate],
    target: usize,
    objective_options: &ObjectiveOptions,
    options: &SolverOptions,
    observer: &Observer,
) -> Result<Vec<f64>, SolveError> {
    let mut interrupted = false;
    let lowest = |candidate: &Candidate| {
        if interrupted {
            return Ok(f64::INFINITY);
        }
        let starts: Vec<Estimate> = candidate
            .starts
            .iter()
            .map(|start| start.estimate.clone())
            .collect();
        let short = short_solves(
            footage,
            candidate.prior,
            target,
            &starts,
            objective_options,
            options.evaluation,
            observer,
        )?;
        interrupted = short.interrupted;
        Ok(short.objectives[short.chosen].1)
    };
    candidates.iter().map(lowest).collect()
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
        goes_on: false,
    };
    let options = SolverOptions {
        max_steps: options.max_steps.min(FREE_STEPS),
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
    let (objective_end, visibility) = judge(&mut objective, &estimate)?;
    let deviations = match descent.termination {
        Termination::Interrupted => None,
        _ => Deviations::at(&mut objective, &visibility, prior.as_ref(), &estimate, styles)?,
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
        objective_end,
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
    let styles = found.style.len();
    let mut objective = Objective::new(
        footage,
        prior.clone(),
        objective_options,
        target,
        found,
        options.threads,
    )?;
    let visibility = objective.visibility(found, 0)?;
    let deviations = Deviations::at(&mut objective, &visibility, prior.as_ref(), found, styles)?;
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
    let (objective, _) = judge(&mut objective, start)?;
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
/// in the prior's frame, without free form; [`complete`] goes on from it, at full resolution where there is a free form, which is left to
/// it then.
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
    let goes_on = options.levels > 1 && prior.form_len(options.free_form) > 0;
    let levels: Vec<usize> = (usize::from(goes_on)..options.levels.min(footage.levels()))
        .rev()
        .collect();
    let route = Route {
        stage: "",
        placing_steps: 0,
        levels: &levels,
        goes_on,
    };
    let (objective_start, _) = judge(&mut objective, &start)?;
    let descent = descend(
        &mut objective,
        footage.sequence(),
        target,
        &start,
        options,
        &route,
        &mut Progress::new(observer),
    )?;
    let (objective_end, _) = judge(&mut objective, &descent.estimate)?;
    Ok(Solution {
        estimate: descent.estimate,
        free_form: Vec::new(),
        deviations: None,
        canonical_from_shape: None,
        objective_start,
        objective_end,
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
