//! Jobs that run side by side, each with a record that outlives an interruption.

use super::{StudyError, write_text};
use crate::prior::bundled;
use crate::solver::TraceRow;
use crate::sources;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// Sees what a study does and may stop it.
pub trait StudyObserver: Sync {
    /// `jobs` more are to be run, beyond those whose records are kept.
    fn planned(&self, jobs: usize);
    /// A solver's iteration within a job; false stops the study.
    fn iteration(&self, job: &str, row: &TraceRow) -> bool;
    /// A job is done, and its record is kept.
    fn finished(&self, job: &str);
}

const DEPENDENCIES: &[u8] = include_bytes!("../../Cargo.lock");

/// Sources that make inputs, or only name, show and write what the others found.
const WITHOUT_SAY: [&str; 13] = [
    "cad",
    "cli",
    "main.rs",
    "study/ablation.rs",
    "study/compare/charts.rs",
    "study/compare/settings.rs",
    "study/compare/tables.rs",
    "study/fig6.rs",
    "study/fig7.rs",
    "study/fig8.rs",
    "study/plot.rs",
    "study/table.rs",
    "study/table1.rs",
];

/// Tells builds apart whose records could differ; a version number would not.
fn build() -> u64 {
    let mut hasher = DefaultHasher::new();
    let counts = |path: &Path| !WITHOUT_SAY.iter().any(|without| path == Path::new(without));
    sources::hash_rust(counts, &mut hasher);
    sources::hash_cpp(&mut hasher);
    bundled().for_each(|prior| prior.hash(&mut hasher));
    (DEPENDENCIES, cfg!(debug_assertions)).hash(&mut hasher);
    hasher.finish()
}

/// Runs jobs and keeps their records in a folder.
pub struct Jobs<'a> {
    folder: PathBuf,
    build: u64,
    observer: &'a dyn StudyObserver,
}

/// A kept record, and what it holds for.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    build: u64,
    key: serde_json::Value,
    record: T,
}

impl<'a> Jobs<'a> {
    /// Records are kept in `folder`.
    pub fn new(folder: &Path, observer: &'a dyn StudyObserver) -> Result<Self, StudyError> {
        std::fs::create_dir_all(folder).map_err(StudyError::io(folder))?;
        Ok(Self {
            folder: folder.to_owned(),
            build: build(),
            observer,
        })
    }

    /// One record per job, in order. `key` is all that decides a job's record besides the build; `work` gets the job
    /// and what sees its iterations.
    ///
    /// # Errors
    /// That of the first job that fails. Jobs that are done by then are kept.
    pub fn run<J: Sync, T: Serialize + DeserializeOwned + Send>(
        &self,
        jobs: &[J],
        name: impl Fn(&J) -> String + Sync,
        key: impl Fn(&J) -> Result<serde_json::Value, StudyError> + Sync,
        work: impl Fn(&J, &(dyn Fn(&TraceRow) -> bool + Sync)) -> Result<T, StudyError> + Sync,
    ) -> Result<Vec<T>, StudyError> {
        let keys: Vec<_> = jobs.iter().map(&key).collect::<Result<_, _>>()?;
        let mut records: Vec<Option<T>> = jobs
            .iter()
            .zip(&keys)
            .map(|(job, key)| self.kept(&name(job), key))
            .collect();
        self.observer
            .planned(records.iter().filter(|record| record.is_none()).count());
        records
            .par_iter_mut()
            .zip(jobs)
            .zip(&keys)
            .try_for_each(|((record, job), key)| {
                if record.is_none() {
                    let name = name(job);
                    let made = work(job, &|row| self.observer.iteration(&name, row))?;
                    *record = Some(self.keep(&name, key, made)?);
                    self.observer.finished(&name);
                }
                Ok::<_, StudyError>(())
            })?;
        Ok(records.into_iter().flatten().collect())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{}.json", name.replace('/', "--")))
    }

    fn kept<T: DeserializeOwned>(&self, name: &str, key: &serde_json::Value) -> Option<T> {
        let text = std::fs::read_to_string(self.path(name)).ok()?;
        let kept: Kept<serde_json::Value> = serde_json::from_str(&text).ok()?;
        (kept.build == self.build && kept.key == *key)
            .then(|| serde_json::from_value(kept.record).ok())
            .flatten()
    }

    fn keep<T: Serialize>(&self, name: &str, key: &serde_json::Value, record: T) -> Result<T, StudyError> {
        let kept = Kept {
            build: self.build,
            key: key.clone(),
            record: &record,
        };
        write_text(&self.path(name), &serde_json::to_string(&kept)?)?;
        Ok(record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    struct Silent;

    impl StudyObserver for Silent {
        fn planned(&self, _: usize) {}
        fn iteration(&self, _: &str, _: &TraceRow) -> bool {
            true
        }
        fn finished(&self, _: &str) {}
    }

    #[test]
    fn done_jobs_are_not_done_again_unless_their_key_changes() {
        let folder = tempfile::tempdir().unwrap();
        let done = AtomicUsize::new(0);
        let run = |offset: f64, fail: bool| {
            let jobs = Jobs::new(folder.path(), &Silent).unwrap();
            jobs.run(
                &[1usize, 2, 3],
                |job| format!("a/{job}"),
                |job| Ok(serde_json::json!([job, offset])),
                |job, _| {
                    if fail && *job == 3 {
                        return Err(StudyError::Interrupted);
                    }
                    done.fetch_add(1, Ordering::SeqCst);
                    Ok(*job as f64 / 3.0 + offset)
                },
            )
        };
        assert!(matches!(run(0.5, true), Err(StudyError::Interrupted)));
        let before = done.load(Ordering::SeqCst);
        let expected = [1.0f64, 2.0, 3.0].map(|job| job / 3.0 + 0.5);
        assert_eq!(run(0.5, false).unwrap(), expected);
        assert_eq!(done.load(Ordering::SeqCst), 3, "{before} of them before");
        assert_eq!(run(0.5, false).unwrap(), expected, "read back to the bit");
        assert_eq!(done.load(Ordering::SeqCst), 3);
        run(0.25, false).unwrap();
        assert_eq!(done.load(Ordering::SeqCst), 6);
    }
}
