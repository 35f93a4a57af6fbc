//! Algorithm 1 from one start: solver calls alternate with the renewal of visibility and, on request, of α (Eq. 8).

use super::{
    Evaluations, ObjectiveValue, Progress, ScaleUpdate, SolverOptions, StepState, Strategy, Termination,
    TraceRow, scale_from_motion,
};
use crate::geometry::{Pose, Vector3};
use crate::init::Estimate;
use crate::objective::{Block, Call, Objective, ObjectiveError};
use crate::sequence::Sequence;
use cpu_time::ThreadTime;

/// What a step of Algorithm 1 moves, in order.
fn blocks(strategy: Strategy) -> &'static [Block] {
    match strategy {
        Strategy::Joint => &[Block::All],
        Strategy::Alternating => &[Block::Target, Block::Motion, Block::Style],
    }
}

/// Where a descent goes, and how it is called in the trace.
pub(super) struct Route<'a> {
    pub stage: &'a str,
    /// Steps at each level, before those of Algorithm 1, that move p0 alone (with α, where it is a variable): a shape that is
    /// free while the pose is far off bends to the wrong pose.
    pub placing_steps: usize,
    /// Pyramid levels in turn.
    pub levels: &'a [usize],
}

/// What one descent did.
pub(super) struct Descent {
    pub estimate: Estimate,
    pub start: ObjectiveValue,
    pub end: ObjectiveValue,
    pub evaluations: Evaluations,
    pub iterations: usize,
    pub termination: Termination,
    pub steps: Vec<StepState>,
    pub trace: Vec<TraceRow>,
    /// Of this thread; a descent uses no other.
    pub cpu_seconds: f64,
}

/// Runs steps of Algorithm 1 along `route`, from where `objective` stands.
pub(super) fn descend(
    objective: &mut Objective,
    sequence: &Sequence,
    options: &SolverOptions,
    route: &Route,
    progress: &mut Progress,
) -> Result<Descent, ObjectiveError> {
    let began = ThreadTime::now();
    let camera_from_input: Vec<Option<Pose>> = sequence.frames.iter().map(|f| f.camera_from_input).collect();
    let mut descent = Descent {
        estimate: objective.estimate()?,
        start: objective.evaluate()?,
        end: ObjectiveValue::default(),
        evaluations: Evaluations::default(),
        iterations: 0,
        termination: Termination::StepLimit,
        steps: Vec::new(),
        trace: Vec::new(),
        cpu_seconds: 0.0,
    };
    'levels: for &level in route.levels {
        objective.set_level(level)?;
        descent.termination = Termination::StepLimit;
        for step in 0..route.placing_steps + options.max_steps {
            let placing = step < route.placing_steps;
            objective.update_visibility()?;
            let before = objective.evaluate()?.total;
            let moved = if placing {
                &[Block::Target]
            } else {
                blocks(options.strategy)
            };
            for &block in moved {
                let call = Call {
                    block,
                    free_alpha: options.scale_update == ScaleUpdate::Variable,
                    minimiser: options.minimiser,
                    max_iterations: options.iterations_per_call,
                    tolerance: options.tolerance / 10.0,
                };
                let so_far = descent.evaluations;
                let outcome = objective.minimise(&call, &mut |iteration| {
                    let evaluations = so_far.plus(iteration.evaluations);
                    progress.report(TraceRow {
                        stage: format!("{}level-{level}", route.stage),
                        step,
                        block: block.name().to_owned(),
                        iteration: iteration.number,
                        objective: iteration.objective,
                        gradient_norm: iteration.gradient_norm,
                        alpha: iteration.alpha,
                        residual_evaluations: evaluations.residual,
                        jacobian_evaluations: evaluations.jacobian,
                        seconds: progress.seconds(),
                    })
                })?;
                descent.evaluations = so_far.plus(outcome.evaluations);
                descent.iterations += outcome.iterations;
                descent.steps.push(StepState {
                    level,
                    estimate: objective.estimate()?,
                    evaluations: descent.evaluations,
                    cpu_seconds: began.elapsed().as_secs_f64(),
                });
                if outcome.interrupted {
                    descent.termination = Termination::Interrupted;
                    break 'levels;
                }
            }
            let after = objective.evaluate()?.total;
            if options.scale_update == ScaleUpdate::Regression
                && let Some(alpha) = scale_from_motion(
                    &objective.estimate()?,
                    &camera_from_input,
                    &mean_point(&objective.points()?),
                )
            {
                objective.set_alpha(alpha)?;
            }
            if after < options.threshold {
                descent.termination = Termination::BelowThreshold;
                break;
            }
            if !placing && before - after <= options.tolerance * before {
                descent.termination = Termination::Converged;
                break;
            }
        }
    }
    objective.set_level(0)?;
    objective.update_visibility()?;
    descent.end = objective.evaluate()?;
    descent.estimate = objective.estimate()?;
    descent.trace = progress.take_trace();
    descent.cpu_seconds = began.elapsed().as_secs_f64();
    Ok(descent)
}

/// x̄ of Eq. 8.
fn mean_point(points: &[f64]) -> Vector3<f64> {
    let sum: Vector3<f64> = points.chunks_exact(3).map(Vector3::from_column_slice).sum();
    sum / (points.len() / 3) as f64
}
