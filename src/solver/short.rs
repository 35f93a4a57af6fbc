//! Short solves from every start, of which the best goes on.

use super::descent::{Route, descend, judge};
use super::progress::{Observer, Progress};
use super::{Evaluation, SolveError, SolverOptions, TraceRow};
use crate::geometry::Pose;
use crate::init::{Estimate, chosen};
use crate::objective::{Footage, Objective, ObjectiveOptions};
use crate::prior::ShapePrior;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A hypothesis is judged with this many of the prior's points.
const HYPOTHESIS_POINTS: usize = 2048;
/// It is judged on this many of the frames; the others follow.
const HYPOTHESIS_FRAMES: usize = 12;
/// Steps of a short solve that move the pose alone, and then those that move all variables, round by round.
const SHORT_SOLVE_STEPS: [(usize, usize); 3] = [(2, 0), (1, 2), (0, 3)];
/// Ceres iterations of each of them.
const SHORT_SOLVE_ITERATIONS: u32 = 4;
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
/// round the worse half of the starts is given up. Of many frames some are looked at, evenly spread and the target among them; each of the
/// others keeps its motion against the nearest of those.
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
    let contest = Contest {
        prior,
        objective_options: &objective_options.cautious(HYPOTHESIS_POINTS, prior.point_count()),
        evaluation,
        observer,
    };
    let count = footage.sequence().frames.len();
    let fits = target < count && starts.iter().all(|start| start.frame_count() == count);
    // What does not fit is the objective's to refuse.
    let mut short = if !fits || count <= HYPOTHESIS_FRAMES {
        contest.between(starts, footage, target)?
    } else {
        let mut frames = chosen(count, target, HYPOTHESIS_FRAMES);
        frames.sort_unstable();
        let sequence = footage.sequence().of_frames(&frames);
        let of_frames = |start: &Estimate| Estimate {
            camera_from_object: frames.iter().map(|&l| start.camera_from_object[l]).collect(),
            ..start.clone()
        };
        let starts_there: Vec<_> = starts.iter().map(of_frames).collect();
        let target_there = frames.iter().position(|&l| l == target).unwrap_or(0);
        let footage = Footage::new(&sequence, footage.levels())?;
        let short = contest.between(&starts_there, &footage, target_there)?;
        ShortSolves {
            estimate: followed(&starts[short.chosen], short.estimate, &frames),
            ..short
        }
    };
    let seconds = began.elapsed().as_secs_f64();
    short.seconds.insert(0, ("hypotheses".to_owned(), seconds));
    Ok(short)
}

/// `found` of some frames, with all those of `start`: each has its motion there against the nearest of `frames`.
fn followed(start: &Estimate, found: Estimate, frames: &[usize]) -> Estimate {
    let motion_scale = found.alpha / start.alpha;
    let of_frame = |l: usize| {
        let nearest = (0..frames.len()).min_by_key(|&k| frames[k].abs_diff(l))?;
        let motion = start.camera_from_object[l].after(&start.camera_from_object[frames[nearest]].inverse());
        let motion = Pose {
            translation: motion_scale * motion.translation,
            ..motion
        };
        Some(motion.after(&found.camera_from_object[nearest]))
    };
    Estimate {
        camera_from_object: (0..start.frame_count()).filter_map(of_frame).collect(),
        ..found
    }
}

/// What all starts have in common.
struct Contest<'a> {
    prior: &'a Arc<dyn ShapePrior>,
    objective_options: &'a ObjectiveOptions,
    evaluation: Evaluation,
    observer: &'a Observer<'a>,
}

impl Contest<'_> {
    /// [`short_solves`] over all frames of `footage`, without their time on the clock.
    fn between(
        &self,
        starts: &[Estimate],
        footage: &Footage,
        target: usize,
    ) -> Result<ShortSolves, SolveError> {
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
            let goes_on = (self.observer)(row);
            stopped.fetch_or(!goes_on, Ordering::Relaxed);
            goes_on
        };
        for (round, &(placing_steps, steps)) in SHORT_SOLVE_STEPS.iter().enumerate() {
            let options = SolverOptions {
                evaluation: self.evaluation,
                max_steps: steps,
                iterations_per_call: Some(SHORT_SOLVE_ITERATIONS),
                tolerance: SHORT_SOLVE_TOLERANCE,
                ..SolverOptions::default()
            };
            trials.par_iter_mut().try_for_each(|trial| {
                if stopped.load(Ordering::Relaxed) {
                    return Ok(());
                }
                let start = &starts[trial.index];
                let mut objective = Objective::new(
                    footage,
                    self.prior.clone(),
                    self.objective_options,
                    target,
                    start,
                    1,
                )?;
                let stage = format!("hypothesis-{}/round-{round}/", trial.index);
                let route = Route {
                    stage: &stage,
                    placing_steps,
                    levels: &[footage.levels() - 1],
                    goes_on: false,
                };
                trial.go_on(&mut objective, footage, target, &route, &options, &observer)
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
            seconds: vec![(
                "hypotheses_cpu".to_owned(),
                trials.iter().map(|trial| trial.cpu_seconds).sum(),
            )],
            trace: trials.into_iter().flat_map(|trial| trial.trace).collect(),
        })
    }
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
        route: &Route,
        options: &SolverOptions,
        observer: &Observer,
    ) -> Result<(), SolveError> {
        if self.trace.is_empty() {
            self.objectives.0 = judge(objective, &self.estimate)?.0.total;
        }
        let descent = descend(
            objective,
            footage.sequence(),
            target,
            &self.estimate,
            options,
            route,
            &mut Progress::new(observer),
        )?;
        self.objectives.1 = judge(objective, &descent.estimate)?.0.total;
        self.estimate = descent.estimate;
        self.trace.extend(descent.trace);
        self.cpu_seconds += descent.cpu_seconds;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};

    #[test]
    fn frames_that_were_not_looked_at_keep_their_motion() {
        let pose = |l: f64| Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.1, 0.3 * l, -0.05 * l)),
            translation: Vector3::new(0.1 * l, -0.2, 1.5 + 0.1 * l),
        };
        let start = Estimate {
            camera_from_object: (0..6).map(|l| pose(f64::from(l))).collect(),
            style: vec![0.0],
            alpha: 0.5,
            focal_factor: 1.0,
        };
        // Another object frame, of which all is twice as large.
        let object_from_found = Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(-0.2, 0.1, 0.4)),
            translation: Vector3::new(0.05, 0.02, -0.1),
        };
        let moved = |l: usize| {
            let pose = start.camera_from_object[l].after(&object_from_found);
            Pose {
                translation: 2.0 * pose.translation,
                ..pose
            }
        };
        let found = Estimate {
            camera_from_object: vec![moved(1), moved(4)],
            style: vec![0.7],
            alpha: 1.0,
            focal_factor: 1.1,
        };
        let all = followed(&start, found, &[1, 4]);
        for (l, pose) in all.camera_from_object.iter().enumerate() {
            let expected = moved(l);
            assert!(
                (pose.rotation.matrix() - expected.rotation.matrix()).norm() < 1e-12,
                "{l}"
            );
            assert!((pose.translation - expected.translation).norm() < 1e-12, "{l}");
        }
        assert_eq!((all.style, all.alpha, all.focal_factor), (vec![0.7], 1.0, 1.1));
    }
}
