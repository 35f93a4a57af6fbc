//! Algorithm 1 from one start: solver calls alternate with the renewal of visibility and of α (Eq. 8).

use super::{
    Evaluations, Minimiser, ObjectiveValue, Progress, SolverOptions, Strategy, Termination, TraceRow,
    scale_from_motion,
};
use crate::bridge::ceres::ffi;
use crate::geometry::{Pose, Vector3};
use crate::init::Estimate;
use crate::objective::{Objective, ObjectiveError};

/// The variables that one Ceres call moves.
#[derive(Clone, Copy)]
enum Block {
    All,
    Target,
    Motion,
    Style,
}

impl Block {
    fn of(strategy: Strategy) -> &'static [Block] {
        match strategy {
            Strategy::Joint => &[Block::All],
            Strategy::Alternating => &[Block::Target, Block::Motion, Block::Style],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Block::All => "all",
            Block::Target => "p0",
            Block::Motion => "motion",
            Block::Style => "style",
        }
    }
}

/// What one descent did.
pub(super) struct Descent {
    pub estimate: Estimate,
    pub start: ObjectiveValue,
    pub end: ObjectiveValue,
    pub evaluations: Evaluations,
    pub iterations: usize,
    pub termination: Termination,
}

/// Runs steps of Algorithm 1 at the pyramid levels `levels` in turn, from where `objective` stands.
pub(super) fn descend(
    objective: &mut Objective,
    camera_from_input: &[Option<Pose>],
    options: &SolverOptions,
    levels: impl Iterator<Item = usize>,
    stage: &str,
    progress: &mut Progress,
) -> Result<Descent, ObjectiveError> {
    let mut descent = Descent {
        estimate: objective.estimate()?,
        start: objective.evaluate()?,
        end: ObjectiveValue::default(),
        evaluations: Evaluations::default(),
        iterations: 0,
        termination: Termination::StepLimit,
    };
    'levels: for level in levels {
        objective.set_level(level)?;
        descent.termination = Termination::StepLimit;
        for step in 0..options.max_steps {
            objective.update_visibility()?;
            let before = objective.evaluate()?.total;
            for &block in Block::of(options.strategy) {
                let interrupted = call(
                    objective,
                    options,
                    block,
                    &mut descent,
                    |iteration, evaluations, alpha| {
                        progress.report(TraceRow {
                            stage: format!("{stage}level-{level}"),
                            step,
                            block: block.name().to_owned(),
                            iteration: iteration.number as usize,
                            objective: iteration.terms.into(),
                            gradient_norm: iteration.gradient_norm,
                            alpha,
                            residual_evaluations: evaluations.residual,
                            jacobian_evaluations: evaluations.jacobian,
                            seconds: progress.seconds(),
                        })
                    },
                )?;
                if interrupted {
                    descent.termination = Termination::Interrupted;
                    break 'levels;
                }
            }
            let after = objective.evaluate()?.total;
            let estimate = objective.estimate()?;
            if let Some(alpha) =
                scale_from_motion(&estimate, camera_from_input, &mean_point(&objective.points()?))
            {
                objective.set_alpha(alpha)?;
            }
            if after < options.threshold {
                descent.termination = Termination::BelowThreshold;
                break;
            }
            if before - after <= options.tolerance * before {
                descent.termination = Termination::Converged;
                break;
            }
        }
    }
    objective.set_level(0)?;
    objective.update_visibility()?;
    descent.end = objective.evaluate()?;
    descent.estimate = objective.estimate()?;
    Ok(descent)
}

/// One Ceres call on `block`; true if it was interrupted.
fn call(
    objective: &mut Objective,
    options: &SolverOptions,
    block: Block,
    descent: &mut Descent,
    mut on_iteration: impl FnMut(&ffi::Iteration, Evaluations, f64) -> bool,
) -> Result<bool, ObjectiveError> {
    let (line_search, lbfgs_rank, initial_trust_region_radius) = match options.minimiser {
        Minimiser::Lm {
            initial_trust_region_radius,
        } => (false, 1, initial_trust_region_radius),
        Minimiser::Lbfgs { rank } => (true, rank, 1.0),
    };
    let alpha = objective.estimate()?.alpha;
    let so_far = descent.evaluations;
    let summary = objective.solve(
        &ffi::SolveOptions {
            free_target: matches!(block, Block::All | Block::Target),
            free_motion: matches!(block, Block::All | Block::Motion),
            free_style: matches!(block, Block::All | Block::Style),
            line_search,
            lbfgs_rank,
            initial_trust_region_radius,
            max_iterations: options.iterations_per_call,
            function_tolerance: options.tolerance / 10.0,
        },
        &mut |iteration| {
            let evaluations = Evaluations {
                residual: so_far.residual + iteration.residual_evaluations as usize,
                jacobian: so_far.jacobian + iteration.jacobian_evaluations as usize,
            };
            on_iteration(iteration, evaluations, alpha)
        },
    )?;
    descent.evaluations.residual += summary.residual_evaluations as usize;
    descent.evaluations.jacobian += summary.jacobian_evaluations as usize;
    descent.iterations += summary.iterations as usize;
    Ok(summary.stop == ffi::Stop::Interrupted)
}

/// x̄ of Eq. 8.
fn mean_point(points: &[f64]) -> Vector3<f64> {
    let sum: Vector3<f64> = points.chunks_exact(3).map(Vector3::from_column_slice).sum();
    sum / (points.len() / 3) as f64
}
