//! A sequence in a study: its common start, and runs of methods from there.

use super::{Effort, Jobs, Measures, Method, StudyError};
use crate::config::Config;
use crate::eval::Platform;
use crate::init::{Estimate, InitOptions, initialise};
use crate::objective::{Footage, ObjectiveOptions};
use crate::prior::{self, LearnedPrior, ShapePrior};
use crate::report::Surface;
use crate::sequence::{LoadOptions, Sequence, load};
use crate::solver::{self, Evaluation, Evaluations, ObjectiveValue, Termination};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A sequence that a study runs on.
pub struct Subject {
    /// The sequence's name in tables.
    pub name: String,
    /// The frames, and the truth where it is known.
    pub sequence: Sequence,
    /// The turning platform of a natural sequence; `None` for others.
    pub platform: Option<Platform>,
    digest: u64,
}

/// The starting points of all methods on a subject.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// The hypothesis whose template fits the masks best, as the paper starts; the mean style.
    pub template: Estimate,
    /// The best of the short solves.
    pub short: Estimate,
}

/// What a method found on a subject.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Before the free form, in the prior's frame.
    pub joint: Estimate,
    /// The final variables, canonical object frame.
    pub estimate: Estimate,
    /// The errors of `estimate` and its shape.
    pub measures: Measures,
    /// The objective before the first iteration.
    pub objective_start: ObjectiveValue,
    /// The objective after the last iteration.
    pub objective_end: ObjectiveValue,
    /// Evaluations counted by Ceres.
    pub evaluations: Evaluations,
    /// Ceres iterations.
    pub iterations: usize,
    /// Why the solve stopped.
    pub termination: Termination,
    /// Processor seconds of the solve, the free form's included.
    pub cpu_seconds: f64,
}

impl Subject {
    /// A sequence, or a natural one with `turn.txt` and `times.txt` beside it and perhaps openMVS depth in `openmvs/`.
    pub fn load(name: &str, folder: &Path, mut options: LoadOptions) -> Result<Self, StudyError> {
        let openmvs = folder.join("openmvs");
        if options.depth.is_none() && openmvs.is_dir() {
            options.depth = Some(openmvs);
        }
        let sequence = load(folder, &options).map_err(|source| StudyError::Sequence {
            name: name.to_owned(),
            source: Box::new(source),
        })?;
        let (turn, times) = (folder.join("turn.txt"), folder.join("times.txt"));
        let platform = turn
            .exists()
            .then(|| Platform::load(&turn, &times))
            .transpose()
            .map_err(|source| StudyError::Platform {
                name: name.to_owned(),
                source,
            })?;
        Ok(Self {
            name: name.to_owned(),
            digest: digest(&sequence),
            sequence,
            platform,
        })
    }

    /// A digest of all that a solve or a measure can depend on.
    pub(super) fn digest(&self) -> u64 {
        self.digest
    }

    /// The start, from the cache or by initialisation and short solves with the defaults.
    pub fn start(&self, jobs: &Jobs, effort: Effort) -> Result<Start, StudyError> {
        let Config { prior, init, .. } = Config::default();
        self.start_by(prior, init, jobs, effort)
    }

    /// The start with another prior or initialisation than the defaults.
    pub(super) fn start_by(
        &self,
        prior: String,
        init: InitOptions,
        jobs: &Jobs,
        effort: Effort,
    ) -> Result<Start, StudyError> {
        let mut config = Config {
            prior,
            init,
            ..Method::ours().with(effort).config
        };
        if effort == Effort::Quick {
            config.init.hypotheses.count = 2;
        }
        let key = json!([self.digest, config, prior_digest(&config.prior)]);
        let starts = jobs.run(
            &[()],
            |()| format!("{}/start", self.name),
            |()| Ok(key.clone()),
            |(), observer| {
                let target = self.sequence.frames.len() / 2;
                let prior: Arc<dyn ShapePrior> = Arc::new(prior::find(&config.prior)?);
                let mean_style = vec![0.0; prior.style_len()];
                let name = || self.name.clone();
                let starts = initialise(&self.sequence, prior.as_ref(), &mean_style, target, &config.init)
                    .map_err(|source| StudyError::Init { name: name(), source })?;
                let estimates: Vec<Estimate> = starts.iter().map(|start| start.estimate.clone()).collect();
                let footage = self.footage(config.solver.levels)?;
                let short = short_solves(&footage, &prior, target, &estimates, observer, name)?;
                Ok(Start {
                    template: starts[0].estimate.clone(),
                    short: short.estimate,
                })
            },
        )?;
        starts.into_iter().next().ok_or(StudyError::Interrupted)
    }

    /// Every method from its start, side by side.
    pub fn runs(&self, jobs: &Jobs, methods: &[(Method, Estimate)]) -> Result<Vec<Run>, StudyError> {
        jobs.run(
            methods,
            |(method, _)| format!("{}/{}", self.name, method.name),
            |(method, start)| Ok(json!([self.digest, method.config, start])),
            |(method, start), observer| self.run(method, start, observer),
        )
    }

    fn run(&self, method: &Method, start: &Estimate, observer: &solver::Observer) -> Result<Run, StudyError> {
        let config = &method.config;
        let target = config.input.target.unwrap_or(self.sequence.frames.len() / 2);
        let learned = prior::find(&config.prior)?;
        let prior: Arc<dyn ShapePrior> = Arc::new(learned.clone());
        let failed = |source| StudyError::Solve {
            name: format!("{}/{}", self.name, method.name),
            source,
        };
        let footage = self.footage(config.solver.levels)?;
        let (objective, solver) = (&config.objective, &config.solver);
        let refined =
            solver::refine(&footage, &prior, target, start, objective, solver, observer).map_err(failed)?;
        let joint = refined.estimate.clone();
        let solution = solver::complete(&footage, &prior, target, refined, objective, solver, observer)
            .map_err(failed)?;
        if solution.termination == Termination::Interrupted {
            return Err(StudyError::Interrupted);
        }
        let surface = Surface::of(&learned, &solution);
        let estimate = solution.estimate;
        Ok(Run {
            measures: Measures::of_estimate(&self.sequence, self.platform.as_ref(), &surface, &estimate),
            joint,
            estimate,
            objective_start: solution.objective_start,
            objective_end: solution.objective_end,
            evaluations: solution.evaluations,
            iterations: solution.iterations,
            termination: solution.termination,
            cpu_seconds: solution
                .seconds
                .iter()
                .filter(|(stage, _)| stage == "solve_cpu" || stage == "free_form_cpu")
                .map(|(_, seconds)| seconds)
                .sum(),
        })
    }

    pub(super) fn footage(&self, levels: usize) -> Result<Footage<'_>, StudyError> {
        Footage::new(&self.sequence, levels).map_err(|source| StudyError::Objective {
            name: self.name.clone(),
            source,
        })
    }

    /// Measures of an estimate in the prior's frame.
    pub fn measure(&self, prior: &LearnedPrior, estimate: &Estimate) -> Measures {
        let (surface, estimate) = Surface::of_estimate(prior, estimate);
        Measures::of_estimate(&self.sequence, self.platform.as_ref(), &surface, &estimate)
    }
}

/// As [`solver::short_solves`] with the defaults; an interruption is an error, since half a short solve is no start.
pub(super) fn short_solves(
    footage: &Footage,
    prior: &Arc<dyn ShapePrior>,
    target: usize,
    starts: &[Estimate],
    observer: &solver::Observer,
    name: impl FnOnce() -> String,
) -> Result<solver::ShortSolves, StudyError> {
    let stopped = AtomicBool::new(false);
    let watched = |row: &solver::TraceRow| {
        let go_on = observer(row);
        stopped.fetch_or(!go_on, Ordering::SeqCst);
        go_on
    };
    let short = solver::short_solves(
        footage,
        prior,
        target,
        starts,
        &ObjectiveOptions::default(),
        Evaluation::default(),
        &watched,
    )
    .map_err(|source| StudyError::Solve { name: name(), source })?;
    match stopped.into_inner() {
        true => Err(StudyError::Interrupted),
        false => Ok(short),
    }
}

/// A digest of a prior's file; `None` for a bundled prior, which the build's digest holds.
pub(super) fn prior_digest(name_or_path: &str) -> Option<u64> {
    let bytes = std::fs::read(name_or_path).ok()?;
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    Some(hasher.finish())
}

/// A digest of all that a solve or a measure can depend on.
fn digest(sequence: &Sequence) -> u64 {
    let mut hasher = DefaultHasher::new();
    for deviation in [sequence.motion_deviation, sequence.focal_deviation] {
        deviation.map(f64::to_bits).hash(&mut hasher);
    }
    let mut number = |value: f64| value.to_bits().hash(&mut hasher);
    for frame in &sequence.frames {
        let camera = frame.camera;
        [camera.fx, camera.fy, camera.cx, camera.cy]
            .into_iter()
            .for_each(&mut number);
        for pose in frame.camera_from_input.iter() {
            pose.to_twist().iter().for_each(|&x| number(x));
        }
        for &value in frame.image.data().as_flattened() {
            number(f64::from(value));
        }
        for &inside in frame.mask.data() {
            number(f64::from(u8::from(inside)));
        }
        for &z in frame.depth.iter().flat_map(|depth| depth.data()) {
            number(f64::from(z));
        }
    }
    if let Some(truth) = &sequence.truth {
        for pose in &truth.camera_from_object {
            pose.to_twist().iter().for_each(|&x| number(x));
        }
        for &z in truth.depth.iter().flat_map(|depth| depth.data()) {
            number(f64::from(z));
        }
        for &x in truth.shape.as_flattened() {
            number(f64::from(x));
        }
    }
    hasher.finish()
}
