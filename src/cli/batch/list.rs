//! The list of sequences, and what was solved of it how.

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const SCHEMA: u32 = 1;

/// The file as it stands.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    #[serde(default)]
    options: Vec<String>,
    sequences: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    input: PathBuf,
    name: Option<String>,
    #[serde(default)]
    options: Vec<String>,
}

/// What to solve: at least one job, all of different names.
pub(super) struct List {
    pub jobs: Vec<Job>,
}

/// One sequence of the list.
#[derive(Debug)]
pub(super) struct Job {
    /// A file name without extension.
    pub name: String,
    /// The input's path from the current folder.
    pub input: PathBuf,
    /// The options of `solve`, besides `--out`.
    pub options: Vec<String>,
}

/// How a sequence was solved: `NAME.toml` beside its result.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Record {
    input: PathBuf,
    options: Vec<String>,
}

impl List {
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let place = || path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(place)?;
        let deserializer = toml::Deserializer::parse(&text)
            .map_err(|error| anyhow::anyhow!("{}", error.message()))
            .with_context(place)?;
        let file: File = serde_path_to_error::deserialize(deserializer)
            .map_err(|error| anyhow::anyhow!("{}: {}", error.path(), error.inner().message()))
            .with_context(place)?;
        ensure!(
            file.schema == SCHEMA,
            "{}: schema: {SCHEMA} expected, found {}",
            place(),
            file.schema
        );
        ensure!(
            !file.sequences.is_empty(),
            "{}: sequences: there is none; give at least one",
            place()
        );
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut taken = BTreeSet::new();
        let mut jobs = Vec::new();
        for (index, entry) in file.sequences.into_iter().enumerate() {
            let job = Job::of(entry, folder, &file.options)
                .and_then(|job| {
                    ensure!(
                        taken.insert(job.name.clone()),
                        "name: a second `{}`; give it another",
                        job.name
                    );
                    Ok(job)
                })
                .with_context(|| format!("{}: sequences[{index}]", place()))?;
            jobs.push(job);
        }
        Ok(Self { jobs })
    }
}

impl Job {
    fn of(entry: Entry, folder: &Path, common: &[String]) -> anyhow::Result<Self> {
        let of_input = || {
            let stem = entry.input.file_stem()?.to_str()?;
            Some(stem.to_owned())
        };
        let name = entry.name.clone().or_else(of_input);
        let name = name.context("input: it has no name of its own; give one as `name`")?;
        let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
        ensure!(
            name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(plain),
            "name: `{name}` is no file name of letters, digits, `.`, `_` and `-`; give one as `name`"
        );
        let options = [common, &entry.options].concat();
        let own = |option: &&String| *option == "-o" || *option == "--out" || option.starts_with("--out=");
        if let Some(option) = options.iter().find(own) {
            bail!("options: {option} is batch's own; leave it out");
        }
        Ok(Self {
            name,
            input: folder.join(entry.input),
            options,
        })
    }

    pub fn result(&self, out: &Path) -> PathBuf {
        out.join(&self.name)
    }

    /// Fails where there is a result that was solved otherwise.
    pub fn check_record(&self, out: &Path) -> anyhow::Result<()> {
        let path = self.record_path(out);
        if !self.result(out).exists() || !path.exists() {
            return Ok(());
        }
        let place = || path.display().to_string();
        let text = std::fs::read_to_string(&path).with_context(place)?;
        let record: Record = toml::from_str(&text)
            .map_err(|error| anyhow::anyhow!("{}", error.message()))
            .with_context(place)?;
        ensure!(
            record == self.record(),
            "{}: its result is of another input or other options than the list's; remove it, or name another --out",
            self.result(out).display()
        );
        Ok(())
    }

    pub fn write_record(&self, out: &Path) -> anyhow::Result<()> {
        let path = self.record_path(out);
        let text = toml::to_string(&self.record()).context("the record of a solve")?;
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    }

    fn record(&self) -> Record {
        Record {
            input: self.input.clone(),
            options: self.options.clone(),
        }
    }

    fn record_path(&self, out: &Path) -> PathBuf {
        out.join(format!("{}.toml", self.name))
    }
}
