//! Algorithm 1 from one start: solver calls alternate with the renewal of visibility and, on request, of α (Eq. 8).

use super::{
    Evaluations, Minimiser, ObjectiveValue, Progress, ScaleUpdate, SolverOptions, StepState, Strategy,
    Termination, TraceRow, scale_from_motion,
};
use crate::geometry::{Pose, Vector3};
use crate::init::Estimate;
use crate::objective::{Block, Call, Iteration, Objective, ObjectiveError, Visibility};
use crate::sequence::Sequence;
use cpu_time::{ProcessTime, ThreadTime};
use std::collections::HashMap;

/// A level ends at so many times [`SolverOptions::tolerance`] where something goes on from there.
const COARSE_TOLERANCE: f64 = 10.0;

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
    /// Whether something goes on from the last of them.
    pub goes_on: bool,
}

/// The objective at full resolution, under its own visibility.
pub(super) fn judge(
    objective: &mut Objective,
    estimate: &Estimate,
) -> Result<(ObjectiveValue, Visibility), ObjectiveError> {
    let visibility = objective.visibility(estimate, 0)?;
    Ok((objective.evaluate(estimate, &visibility)?, visibility))
}

/// What one descent did.
pub(super) struct Descent {
    pub estimate: Estimate,
    pub evaluations: Evaluations,
    pub iterations: usize,
    pub termination: Termination,
    pub steps: Vec<StepState>,
    pub trace: Vec<TraceRow>,
    pub cpu_seconds: f64,
}

/// Runs steps of Algorithm 1 along `route`, from `start`, with `target` as the target frame.
pub(super) fn descend(
    objective: &mut Objective,
    sequence: &Sequence,
    target: usize,
    start: &Estimate,
    options: &SolverOptions,
    route: &Route,
    progress: &mut Progress,
) -> Result<Descent, ObjectiveError> {
    let clock = CpuClock::start(options.threads);
    let camera_from_input: Vec<Option<Pose>> = sequence.frames.iter().map(|f| f.camera_from_input).collect();
    let mut last_visibility: Option<Visibility> = None;
    let mut descent = Descent {
        estimate: start.clone(),
        evaluations: Evaluations::default(),
        iterations: 0,
        termination: Termination::StepLimit,
        steps: Vec::new(),
        trace: Vec::new(),
        cpu_seconds: 0.0,
    };
    let mut minimisers = Minimisers::new(options.minimiser);
    'levels: for (place, &level) in route.levels.iter().enumerate() {
        descent.termination = Termination::StepLimit;
        let tolerance = if route.goes_on || place + 1 < route.levels.len() {
            COARSE_TOLERANCE * options.tolerance
        } else {
            options.tolerance
        };
        let mut stall = StallDetector::new(tolerance);
        for step in 0..route.placing_steps + options.max_steps {
            let placing = step < route.placing_steps;
            let visibility = match &last_visibility {
                None => objective.visibility(&descent.estimate, level)?,
                Some(last) => objective.next_visibility(&descent.estimate, level, last)?,
            };
            let visibility = &*last_visibility.insert(visibility);
            // As the calls themselves see it: at the step's start, and at its end.
            let (mut before, mut after) = (None, f64::INFINITY);
            let mut is_stalled = false;
            let moved = if placing {
                &[Block::Target]
            } else {
                blocks(options.strategy)
            };
            for &block in moved {
                let stage = format!("{}level-{level}", route.stage);
                let is_stopped = descent.minimise(
                    objective,
                    visibility,
                    block,
                    (options, &mut minimisers),
                    &mut |iteration, so_far| {
                        let total = iteration.objective.total;
                        let is_start = iteration.number == 0;
                        after = if is_start { total } else { after.min(total) };
                        if before.is_none() {
                            before = Some(total);
                            is_stalled = !placing && !stall.progresses(total);
                            if is_stalled {
                                return false;
                            }
                        }
                        let seconds = progress.seconds();
                        progress.report(row(&stage, step, block, iteration, so_far, seconds))
                    },
                )?;
                if is_stalled {
                    descent.termination = Termination::Converged;
                    continue 'levels;
                }
                descent.steps.push(StepState {
                    level,
                    estimate: descent.estimate.clone(),
                    iterations: descent.iterations,
                    evaluations: descent.evaluations,
                    cpu_seconds: clock.seconds(),
                });
                if is_stopped {
                    descent.termination = Termination::Interrupted;
                    break 'levels;
                }
            }
            if options.scale_update == ScaleUpdate::Regression {
                let mean = mean_point(&objective.points(&descent.estimate));
                let alpha = scale_from_motion(&descent.estimate, target, &camera_from_input, &mean);
                descent.estimate.alpha = alpha.unwrap_or(descent.estimate.alpha);
            }
            if after < options.threshold {
                descent.termination = Termination::BelowThreshold;
                break;
            }
            let won = before.map_or(0.0, |before| (before - after) / before);
            // Where no step was taken at all, the next call tries smaller ones.
            if !placing && won > 0.0 && won <= tolerance {
                descent.termination = Termination::Converged;
                break;
            }
        }
    }
    descent.trace = progress.take_trace();
    descent.cpu_seconds = clock.seconds();
    Ok(descent)
}

/// What the trace says of an iteration of a call before which `so_far` was evaluated.
fn row(
    stage: &str,
    step: usize,
    block: Block,
    iteration: &Iteration,
    so_far: Evaluations,
    seconds: f64,
) -> TraceRow {
    let evaluations = so_far.plus(iteration.evaluations);
    TraceRow {
        stage: stage.to_owned(),
        step,
        block: block.name().to_owned(),
        iteration: iteration.number,
        objective: iteration.objective,
        gradient_norm: iteration.gradient_norm,
        alpha: iteration.alpha,
        residual_evaluations: evaluations.residual,
        jacobian_evaluations: evaluations.jacobian,
        seconds,
    }
}

impl Descent {
    /// One Ceres call that moves `block`, and whether the observer ended it, who sees every iteration and the evaluations before the call.
    fn minimise(
        &mut self,
        objective: &mut Objective,
        visibility: &Visibility,
        block: Block,
        (options, minimisers): (&SolverOptions, &mut Minimisers),
        observer: &mut dyn FnMut(&Iteration, Evaluations) -> bool,
    ) -> Result<bool, ObjectiveError> {
        let call = Call {
            block,
            free_alpha: options.scale_update == ScaleUpdate::Variable,
            minimiser: minimisers.of(block),
            evaluation: options.evaluation,
            max_iterations: options.iterations_per_call(),
            tolerance: options.tolerance / 10.0,
        };
        let so_far = self.evaluations;
        let outcome = objective.minimise(&mut self.estimate, visibility, &call, &mut |iteration| {
            observer(iteration, so_far)
        })?;
        minimisers.ended(block, outcome.trust_region_radius);
        self.evaluations = so_far.plus(outcome.evaluations);
        self.iterations += outcome.iterations;
        Ok(outcome.interrupted)
    }
}

/// The minimiser of each block's next call: its trust region is as large as the last call left it, but no larger than at first. A call of few
/// iterations that all begin too large would take no step, and no call after it either.
struct Minimisers {
    first: Minimiser,
    radii: HashMap<Block, f64>,
}

impl Minimisers {
    /// Share of the first radius below which a call left no step to take: the next one, which sees a new visibility, begins there.
    const LEAST_RADIUS: f64 = 1e-6;

    fn new(first: Minimiser) -> Self {
        Self {
            first,
            radii: HashMap::new(),
        }
    }

    fn of(&self, block: Block) -> Minimiser {
        match (self.first, self.radii.get(&block)) {
            (
                Minimiser::Lm {
                    initial_trust_region_radius: first,
                    linear_solver,
                },
                Some(&last),
            ) => Minimiser::Lm {
                initial_trust_region_radius: last.clamp(Self::LEAST_RADIUS * first, first),
                linear_solver,
            },
            (first, _) => first,
        }
    }

    fn ended(&mut self, block: Block, radius: f64) {
        self.radii.insert(block, radius);
    }
}

/// Processor time of a solve: of its thread where it uses no other, so that solves may run side by side, else of the process.
enum CpuClock {
    Thread(ThreadTime),
    Process(ProcessTime),
}

impl CpuClock {
    fn start(threads: usize) -> Self {
        match threads {
            0 | 1 => Self::Thread(ThreadTime::now()),
            _ => Self::Process(ProcessTime::now()),
        }
    }

    fn seconds(&self) -> f64 {
        match self {
            Self::Thread(began) => began.elapsed().as_secs_f64(),
            Self::Process(began) => began.elapsed().as_secs_f64(),
        }
    }
}

/// The objective at the start of each step, under its own visibility: a call lowers it for the visibility that it began
/// with, and the renewal may undo that, over and over.
struct StallDetector {
    tolerance: f64,
    lowest: f64,
    steps_since: usize,
}

impl StallDetector {
    /// So many steps in a row that do not go below the lowest are enough.
    const PATIENCE: usize = 2;

    fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            lowest: f64::INFINITY,
            steps_since: 0,
        }
    }

    /// Notes the next step's objective; false if the last ones were no progress.
    fn progresses(&mut self, objective: f64) -> bool {
        self.steps_since = match objective < (1.0 - self.tolerance) * self.lowest {
            true => 0,
            false => self.steps_since + 1,
        };
        self.lowest = self.lowest.min(objective);
        self.steps_since < Self::PATIENCE
    }
}

/// x̄ of Eq. 8.
fn mean_point(points: &[f64]) -> Vector3<f64> {
    let sum: Vector3<f64> = points.chunks_exact(3).map(Vector3::from_column_slice).sum();
    sum / (points.len() / 3) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radius(minimiser: Minimiser) -> f64 {
        match minimiser {
            Minimiser::Lm {
                initial_trust_region_radius,
                ..
            } => initial_trust_region_radius,
            Minimiser::Lbfgs { .. } => panic!("a line search has no trust region"),
        }
    }

    #[test]
    fn a_blocks_trust_region_goes_on_within_bounds() {
        let first = radius(SolverOptions::default().minimiser);
        let mut minimisers = Minimisers::new(SolverOptions::default().minimiser);
        assert_eq!(radius(minimisers.of(Block::All)), first);
        minimisers.ended(Block::All, first / 50.0);
        assert_eq!(radius(minimisers.of(Block::All)), first / 50.0);
        assert_eq!(radius(minimisers.of(Block::Target)), first, "another block's");
        minimisers.ended(Block::All, 0.0);
        assert_eq!(
            radius(minimisers.of(Block::All)),
            Minimisers::LEAST_RADIUS * first,
            "some step is left to take"
        );
        minimisers.ended(Block::All, 9.0 * first);
        assert_eq!(radius(minimisers.of(Block::All)), first);
    }

    #[test]
    fn two_steps_without_a_new_lowest_objective_are_enough() {
        let mut stall = StallDetector::new(1e-3);
        assert!(stall.progresses(10.0));
        assert!(stall.progresses(11.0), "the first one without");
        assert!(stall.progresses(9.0), "a new lowest");
        assert!(stall.progresses(8.999), "lower, but by less than the tolerance");
        assert!(!stall.progresses(9.5));
    }
}
