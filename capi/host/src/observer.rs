//! What a host sees of a solve, and how it stops it.

use crate::log::Severity;
use spba_ceres::solver::TraceRow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// How far a solve is.
pub struct Progress<'a> {
    /// `initialise`, or as in `trace.csv`.
    pub stage: &'a str,
    /// The solver call within the stage.
    pub step: usize,
    /// The Ceres iteration within the call; 0 is its start.
    pub iteration: usize,
    /// Not a number before the first iteration.
    pub objective: f64,
    /// Since the solve began.
    pub seconds: f64,
}

/// Called from one thread at a time; false stops the solve.
pub type Observer = dyn Fn(&Progress) -> bool + Send + Sync;
/// Called from one thread at a time.
pub type LogSink = dyn Fn(Severity, &str) + Send + Sync;

/// Calls an observer from many threads, one at a time, until it says stop.
pub struct SerialObserver<'a> {
    observer: Option<&'a Observer>,
    began: Instant,
    stopped: AtomicBool,
    one_at_a_time: Mutex<()>,
}

impl<'a> SerialObserver<'a> {
    /// Calls `observer`; without one every call goes on.
    pub fn new(observer: Option<&'a Observer>) -> Self {
        Self {
            observer,
            began: Instant::now(),
            stopped: AtomicBool::new(false),
            one_at_a_time: Mutex::new(()),
        }
    }

    /// Before every template.
    pub fn initialising(&self) -> bool {
        self.goes_on("initialise", 0, 0, f64::NAN)
    }

    /// After every iteration.
    pub fn see(&self, row: &TraceRow) -> bool {
        self.goes_on(&row.stage, row.step, row.iteration, row.objective.total)
    }

    fn goes_on(&self, stage: &str, step: usize, iteration: usize, objective: f64) -> bool {
        let Some(observer) = self.observer else {
            return true;
        };
        let _one = self.one_at_a_time.lock().unwrap_or_else(PoisonError::into_inner);
        if self.stopped.load(Ordering::SeqCst) {
            return false;
        }
        let goes_on = observer(&Progress {
            stage,
            step,
            iteration,
            objective,
            seconds: self.began.elapsed().as_secs_f64(),
        });
        self.stopped.store(!goes_on, Ordering::SeqCst);
        goes_on
    }
}
