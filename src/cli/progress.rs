//! What a person sees of long work on standard error, and how Ctrl-C ends it.

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use spba_ceres::solver::TraceRow;
use spba_ceres::study::StudyObserver;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Where no terminal shows a bar, a line comes as often as this.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// How far long work is: a bar on a terminal, a plain line now and then elsewhere.
pub struct Progress {
    bar: ProgressBar,
    plain: bool,
    shown: Mutex<Shown>,
}

struct Shown {
    stage: String,
    began: Instant,
    /// When the last plain line was written.
    last: Instant,
}

impl Progress {
    pub fn new() -> Self {
        let plain = !std::io::stderr().is_terminal();
        let bar = if plain {
            ProgressBar::hidden()
        } else {
            ProgressBar::new_spinner()
        };
        let now = Instant::now();
        Self {
            bar,
            plain,
            shown: Mutex::new(Shown {
                stage: String::new(),
                began: now,
                last: now,
            }),
        }
    }

    /// `done` of `steps` of a stage; the clock starts anew with every other stage.
    pub fn step(&self, stage: &str, done: usize, steps: usize) {
        self.step_saying(stage, "", done, steps);
    }

    /// The same, with more words about how it goes.
    pub fn step_saying(&self, stage: &str, words: &str, done: usize, steps: usize) {
        let mut shown = self.enter(stage, Some(steps));
        self.bar.set_position(done as u64);
        self.bar.set_message(format!("{stage}{words}"));
        let elapsed = shown.began.elapsed();
        let left = (done > 0 && done < steps).then(|| elapsed.mul_f64((steps - done) as f64 / done as f64));
        let left = left.map_or_else(String::new, |left| {
            format!(", about {} left", HumanDuration(left).to_string().to_lowercase())
        });
        self.line(&mut shown, || format!("{stage}{words}: {done} of {steps}{left}"));
    }

    /// One more step of a stage.
    #[cfg(feature = "vision")]
    pub fn advance(&self, stage: &str, steps: usize) {
        let done = {
            let _shown = self.enter(stage, Some(steps));
            self.bar.inc(1);
            self.bar.position()
        };
        self.step(stage, done as usize, steps);
    }

    /// What a stage that has no end in sight is about.
    pub fn say(&self, stage: &str, words: &str) {
        let mut shown = self.enter(stage, None);
        self.bar.set_message(format!("{stage} {words}"));
        self.bar.tick();
        self.line(&mut shown, || format!("{stage} {words}"));
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn enter(&self, stage: &str, steps: Option<usize>) -> MutexGuard<'_, Shown> {
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        if shown.stage != stage {
            shown.stage = stage.to_owned();
            shown.began = Instant::now();
            self.bar.set_style(style(steps.is_some()));
            self.bar.reset();
            self.bar.set_message(stage.to_owned());
        }
        if let Some(steps) = steps {
            self.bar.set_length(steps as u64);
        }
        shown
    }

    fn line(&self, shown: &mut Shown, words: impl Fn() -> String) {
        if self.plain && shown.last.elapsed() >= LINE_EVERY {
            shown.last = Instant::now();
            eprintln!("{}", words());
        }
    }
}

fn style(with_end: bool) -> ProgressStyle {
    let template = if with_end {
        "{bar:24} {pos}/{len} {elapsed_precise}, {eta} left: {msg}"
    } else {
        "{spinner} {elapsed_precise} {msg}"
    };
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// Follows the solver, and knows when Ctrl-C came.
pub struct SolveProgress {
    progress: Progress,
    interrupted: Arc<AtomicBool>,
}

impl SolveProgress {
    pub fn start() -> anyhow::Result<Self> {
        Ok(Self {
            progress: Progress::new(),
            interrupted: interruption()?,
        })
    }

    /// Shows an iteration; false once the solver should stop.
    pub fn see(&self, row: &TraceRow) -> bool {
        self.progress.say(
            "solve",
            &format!(
                "{} step {} {} iteration {}: objective {:.1}",
                row.stage, row.step, row.block, row.iteration, row.objective.total
            ),
        );
        !self.interrupted.load(Ordering::SeqCst)
    }

    pub fn finish(&self) {
        self.progress.finish();
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

/// Follows the solves of a study.
pub struct StudyWatch {
    progress: Progress,
    /// Solves finished and planned.
    jobs: Mutex<[usize; 2]>,
    interrupted: Arc<AtomicBool>,
}

impl StudyWatch {
    pub fn start() -> anyhow::Result<Self> {
        Ok(Self {
            progress: Progress::new(),
            jobs: Mutex::new([0; 2]),
            interrupted: interruption()?,
        })
    }

    pub fn finish(&self) {
        self.progress.finish();
    }

    fn count(&self, finished: usize, planned: usize) {
        let mut jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner);
        jobs[0] += finished;
        jobs[1] += planned;
        self.progress.step("solves", jobs[0], jobs[1]);
    }
}

impl StudyObserver for StudyWatch {
    fn planned(&self, jobs: usize) {
        self.count(0, jobs);
    }

    fn iteration(&self, _: &str, _: &TraceRow) -> bool {
        self.count(0, 0);
        !self.interrupted.load(Ordering::SeqCst)
    }

    fn finished(&self, _: &str) {
        self.count(1, 0);
    }
}
