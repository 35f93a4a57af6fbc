//! How the solver is watched and stopped.

use super::TraceRow;
use std::time::Instant;

/// Sees every iteration, perhaps of several hypotheses at a time; false stops the solver there.
pub type Observer<'a> = dyn Fn(&TraceRow) -> bool + Sync + 'a;

/// Passes iterations on to the observer and keeps them for the trace.
pub(super) struct Progress<'a> {
    observer: &'a Observer<'a>,
    began: Instant,
    trace: Vec<TraceRow>,
}

impl<'a> Progress<'a> {
    pub fn new(observer: &'a Observer<'a>) -> Self {
        Self {
            observer,
            began: Instant::now(),
            trace: Vec::new(),
        }
    }

    /// Seconds since the descent began.
    pub fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// Shows a row to the observer; false once it wants to stop.
    pub fn report(&mut self, row: TraceRow) -> bool {
        let go_on = (self.observer)(&row);
        self.trace.push(row);
        go_on
    }

    pub fn take_trace(&mut self) -> Vec<TraceRow> {
        std::mem::take(&mut self.trace)
    }
}
