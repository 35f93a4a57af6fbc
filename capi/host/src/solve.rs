//! From frames, prior and options to a solution, on a pool of threads of its own.

use crate::fault::Fault;
use crate::frames::Frames;
use crate::log::Sink;
use crate::observer::{LogSink, Observer, SerialObserver};
use rayon::{ThreadPool, ThreadPoolBuilder};
use spba_ceres::config::{Config, InputOptions, StartOptions};
use spba_ceres::geometry::Similarity;
use spba_ceres::init::initialise_while;
use spba_ceres::objective::Footage;
use spba_ceres::prior::{LearnedPrior, ShapePrior};
use spba_ceres::report::{Surface, silhouette_iou};
use spba_ceres::sequence::Sequence;
use spba_ceres::solver::{self, Solution};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use tracing::Dispatch;
use tracing::dispatcher::with_default;

/// What a solve found, and what follows from it.
pub struct Solved {
    /// The variables, the objective and the trace.
    pub solution: Solution,
    /// `None` where no frame has a pose.
    pub object_from_world: Option<Similarity>,
    /// xyz after xyz, object frame.
    pub points: Vec<f64>,
    /// Outward unit normals of the points, xyz after xyz, object frame.
    pub normals: Vec<f64>,
    /// Indices of points, three a face.
    pub faces: Vec<u32>,
    /// One a frame.
    pub silhouette_iou: Vec<f64>,
}

/// Options of a solve from memory.
///
/// # Errors
/// What the command line refuses in a configuration, and keys about files that such a solve does not read.
pub fn options(toml: &str) -> Result<Config, Fault> {
    let config = Config::parse(toml, Path::new("options"))?;
    let of_files = |key, given: bool| match given {
        true => Err(Fault::Option {
            key,
            problem: "about files, which a solve from memory does not read",
            mend: "leave it out",
        }),
        false => Ok(()),
    };
    let plain = InputOptions {
        target: config.input.target,
        ..InputOptions::default()
    };
    of_files("prior", config.prior != Config::default().prior)?;
    of_files("input", config.input != plain)?;
    of_files("start", config.start != StartOptions::default())?;
    for outcome in [config.objective.check(), config.solver.check()] {
        outcome.map_err(|(key, why)| Fault::Option {
            key,
            problem: "out of range",
            mend: why,
        })?;
    }
    Ok(config)
}

/// Solves. `observer` and `log` are called from threads of the pool.
///
/// # Errors
/// Frames that are no sequence, options that do not fit them, an observer that stops before there is a starting point, or no
/// solution.
pub fn solve(
    frames: &Frames,
    prior: &Arc<LearnedPrior>,
    config: &Config,
    observer: Option<&Observer>,
    log: Option<Arc<LogSink>>,
) -> Result<Solved, Fault> {
    let threads = thread_count(config);
    let dispatch = log.map_or_else(Dispatch::none, |log| {
        let one_at_a_time = Mutex::new(());
        Dispatch::new(Sink::new(move |severity, message: &str| {
            let _one = one_at_a_time.lock().unwrap_or_else(PoisonError::into_inner);
            log(severity, message);
        }))
    });
    let sequence = frames.sequence()?;
    let observer = SerialObserver::new(observer);
    pool(threads, &dispatch)?.install(|| solve_here(&sequence, prior, config, threads, &observer))
}

/// As `threads` says; one a core where it is 0.
pub fn thread_count(config: &Config) -> usize {
    match config.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    }
}

/// A host's own pool, and its own subscriber of `tracing`, are left alone.
fn pool(threads: usize, dispatch: &Dispatch) -> Result<ThreadPool, Fault> {
    Ok(ThreadPoolBuilder::new()
        .num_threads(threads)
        .spawn_handler(|thread| {
            let dispatch = dispatch.clone();
            std::thread::Builder::new()
                .name("spba".to_owned())
                .spawn(move || with_default(&dispatch, || thread.run()))?;
            Ok(())
        })
        .build()?)
}

fn solve_here(
    sequence: &Sequence,
    learned: &Arc<LearnedPrior>,
    config: &Config,
    threads: usize,
    observer: &SerialObserver,
) -> Result<Solved, Fault> {
    let prior: Arc<dyn ShapePrior> = learned.clone();
    let target = config
        .input
        .target_of(sequence.frames.len())
        .map_err(|error| Fault::Target(error.to_string()))?;
    let mean = vec![0.0; prior.style_len()];
    let starts = initialise_while(
        &|| observer.initialising(),
        sequence,
        prior.as_ref(),
        &mean,
        target,
        &config.init,
    )?;
    let options = solver::SolverOptions {
        threads,
        ..config.solver.clone()
    };
    let solution = solver::solve(
        &Footage::new(sequence, options.levels)?,
        &prior,
        target,
        &starts,
        &config.objective,
        &options,
        &|row| observer.see(row),
    )?;
    Ok(Solved::new(sequence, learned, solution))
}

impl Solved {
    fn new(sequence: &Sequence, prior: &LearnedPrior, solution: Solution) -> Self {
        let surface = Surface::of(prior, &solution);
        let flat = |vectors: &[spba_ceres::geometry::Vector3<f64>]| {
            vectors.iter().flat_map(|v| [v.x, v.y, v.z]).collect()
        };
        let estimate = &solution.estimate;
        let seen = sequence.frames.iter().zip(&estimate.camera_from_object);
        Self {
            object_from_world: estimate.object_from_input(sequence),
            points: flat(surface.points()),
            normals: flat(surface.normals()),
            faces: surface.facets().as_flattened().to_vec(),
            silhouette_iou: seen
                .map(|(frame, pose)| {
                    let view = surface.render(&estimate.camera(&frame.camera), pose, frame.image.size());
                    silhouette_iou(&view.mask(), &frame.mask)
                })
                .collect(),
            solution,
        }
    }
}
