//! What a person sees of a running solve, and how Ctrl-C ends it.

use indicatif::{ProgressBar, ProgressStyle};
use spba_ceres::solver::TraceRow;
use spba_ceres::study::Watch as WatchStudy;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// A line on standard error that follows the solver, and the flag that Ctrl-C sets.
pub struct Watch {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
}

impl Watch {
    pub fn start() -> anyhow::Result<Self> {
        let interrupted = interruption()?;
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

/// The flag that the first Ctrl-C sets, which stops solvers at their next iteration; the second ends the program.
pub fn interruption() -> anyhow::Result<Arc<AtomicBool>> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(flag.clone());
    }
    let interrupted = FLAG.get_or_init(|| Arc::new(AtomicBool::new(false))).clone();
    let flag = interrupted.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    })?;
    Ok(interrupted)
}

/// A bar on standard error over the solves of a study.
pub struct StudyWatch {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
}

impl StudyWatch {
    pub fn start() -> anyhow::Result<Self> {
        let style = ProgressStyle::with_template("{bar:24} {pos}/{len} {elapsed_precise} {msg}")?;
        Ok(Self {
            bar: ProgressBar::new(0).with_style(style),
            interrupted: interruption()?,
        })
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl WatchStudy for StudyWatch {
    fn planned(&self, jobs: usize) {
        self.bar.inc_length(jobs as u64);
    }

    fn iteration(&self, job: &str, row: &TraceRow) -> bool {
        self.bar.set_message(format!(
            "{job}: {} step {} objective {:.1}",
            row.stage, row.step, row.objective.total
        ));
        !self.interrupted.load(Ordering::SeqCst)
    }

    fn finished(&self, job: &str) {
        self.bar.set_message(job.to_owned());
        self.bar.inc(1);
    }
}
