//! What a person sees of a running solve, and how Ctrl-C ends it.

use indicatif::{ProgressBar, ProgressStyle};
use spba_ceres::solver::TraceRow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A line on standard error that follows the solver, and the flag that Ctrl-C sets.
pub struct Watch {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
}

impl Watch {
    /// The first Ctrl-C stops the solver at its next iteration; the second ends the program.
    pub fn start() -> anyhow::Result<Self> {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = interrupted.clone();
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        })?;
        let bar = ProgressBar::new_spinner()
            .with_style(ProgressStyle::with_template("{spinner} {elapsed_precise} {msg}")?);
        Ok(Self { bar, interrupted })
    }

    /// Shows an iteration; false once the solver should stop.
    pub fn see(&self, row: &TraceRow) -> bool {
        self.bar.set_message(format!(
            "{} step {} {} iteration {}: objective {:.1}",
            row.stage, row.step, row.block, row.iteration, row.objective.total
        ));
        self.bar.tick();
        !self.interrupted.load(Ordering::SeqCst)
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
