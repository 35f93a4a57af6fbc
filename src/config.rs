//! The configuration of one run, as TOML: what `--config` and `--set` read and what a result folder keeps.

mod setting;

pub use setting::Setting;

use crate::init::InitOptions;
use crate::objective::ObjectiveOptions;
use crate::sequence::{FrameWindow, LoadOptions, WindowError};
use crate::solver::{LinearSolver, Minimiser, SolverOptions, default_lbfgs_rank};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use toml::Table;

/// Everything that decides a result besides the input's files. Every key has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// A bundled prior's name, or the path of a prior file.
    pub prior: String,
    /// Threads over pose hypotheses; 0 = one per core. The result does not depend on it.
    pub threads: usize,
    /// The input: its depth, its frames and its target frame.
    pub input: InputOptions,
    /// Where the style and the poses start.
    pub start: StartOptions,
    /// The search for starting points.
    pub init: InitOptions,
    /// The objective's weights and the sizes of its samples.
    pub objective: ObjectiveOptions,
    /// The minimiser, the strategy and the stopping rules.
    pub solver: SolverOptions,
    /// What the result folder holds besides the solution.
    pub output: OutputOptions,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            prior: "car".to_owned(),
            threads: 0,
            input: InputOptions::default(),
            start: StartOptions::default(),
            init: InitOptions::default(),
            objective: ObjectiveOptions::default(),
            solver: SolverOptions::default(),
            output: OutputOptions::default(),
        }
    }
}

/// What the result says besides what was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputOptions {
    /// The object's real length from front to back, metres; none = not known. `mesh.glb` is then in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
}

impl OutputOptions {
    /// # Errors
    /// The key of what is out of range, and why.
    pub fn check(&self) -> Result<(), (&'static str, &'static str)> {
        match self.length_m {
            Some(metres) if !(metres.is_finite() && metres > 0.0) => Err(("length_m", "must be more than 0")),
            _ => Ok(()),
        }
    }
}

/// Where the solve starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StartOptions {
    /// `mean`; a regressor's file (.safetensors), which looks at the frames; or an earlier result's folder.
    pub style: String,
    /// `templates`, which are compared with the masks, or an earlier result's folder with all frames in use.
    pub pose: String,
}

impl Default for StartOptions {
    fn default() -> Self {
        Self {
            style: "mean".to_owned(),
            pose: "templates".to_owned(),
        }
    }
}

/// Which part of the input is used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InputOptions {
    /// openMVS's folder (`scene.mvs`, `depth*.dmap`) for a COLMAP workspace.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<PathBuf>,
    /// `start..end`, frames counted from 0 in order, the end excluded.
    pub frames: String,
    /// Every so many of these frames.
    pub every: usize,
    /// The target frame (p0, frame 0 of Eq. 4), counted among the frames in use; none = the middle one, which
    /// shares the most with all others. The paper's is 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<usize>,
}

impl Default for InputOptions {
    fn default() -> Self {
        Self {
            depth: None,
            frames: "..".to_owned(),
            every: 1,
            target: None,
        }
    }
}

impl InputOptions {
    /// The index of the target among `frames` frames.
    pub fn target_of(&self, frames: usize) -> Result<usize, TargetError> {
        let target = self.target.unwrap_or(frames / 2);
        if target < frames {
            Ok(target)
        } else {
            Err(TargetError { target, frames })
        }
    }

    /// These options as [`load`](crate::sequence::load) takes them.
    ///
    /// # Errors
    /// `frames` is no range of frames, or `every` is 0.
    pub fn load_options(&self) -> Result<LoadOptions, WindowError> {
        Ok(LoadOptions {
            depth: self.depth.clone(),
            window: FrameWindow::parse(&self.frames, self.every)?,
        })
    }
}

/// The configured target is none of the frames.
#[derive(Debug, thiserror::Error)]
#[error("target {target}: there are {frames} frames in use; give 0 to {}", frames - 1)]
pub struct TargetError {
    target: usize,
    frames: usize,
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The configuration file cannot be read.
    #[error("{}: cannot read the configuration: {problem}", path.display())]
    Read {
        /// The configuration file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The configuration file is no TOML, a key in it is unknown, or a value is none that the key can hold.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The configuration file.
        path: PathBuf,
        /// The line, the key, what is wrong and how to mend it.
        message: String,
    },
    /// A key from the command line, `given` as it stands there.
    #[error("{given}: {message}")]
    Setting {
        /// The setting as it stands on the command line, `key=value`.
        given: String,
        /// What is wrong with it, and how to mend it.
        message: String,
    },
    /// The configuration holds a value that TOML cannot express.
    #[error("the configuration has no form in TOML: {0}")]
    Write(#[from] toml::ser::Error),
}

/// Keys that TOML cannot express while they have no value: section, key, a value, what its absence means.
const ABSENT: [(&str, &str, &str, &str); 5] = [
    ("input", "depth", "\"openmvs\"", "no openMVS depth"),
    ("input", "target", "0", "the middle one of the frames in use"),
    (
        "objective",
        "motion_deviation",
        "0.001",
        "what the sequence says of itself, or 0 where it says nothing",
    ),
    (
        "objective",
        "focal_deviation",
        "0.1",
        "what the sequence says of itself, or 0 where it says nothing",
    ),
    ("solver", "iterations_per_call", "5", "5 of LM, 20 of L-BFGS"),
];

/// The end of every error about a key.
const MEND: &str = "`spba-ceres solve --print-config` shows every key with a value";

impl Config {
    /// Reads a TOML file. Keys that it does not name keep their defaults.
    ///
    /// # Errors
    /// A file that cannot be read, no TOML, an unknown key, a value that the key cannot hold.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::layered(Some(path), &[])
    }

    /// Parses the text of a configuration file; messages call it `name`.
    ///
    /// ```
    /// use spba_ceres::config::Config;
    /// use std::path::Path;
    ///
    /// let config = Config::parse("solver = { max_steps = 3 }", Path::new("mine"))?;
    /// assert_eq!(config.solver.max_steps, 3);
    /// assert_eq!(config.solver.levels, Config::default().solver.levels);
    /// assert!(Config::parse("solver = { steps = 3 }", Path::new("mine")).is_err());
    /// # Ok::<(), spba_ceres::config::ConfigError>(())
    /// ```
    ///
    /// # Errors
    /// No TOML, an unknown key, a value that the key cannot hold.
    pub fn parse(text: &str, name: &Path) -> Result<Self, ConfigError> {
        Self::laid_over_defaults(Some((table(text, name)?, name)), &[])
    }

    /// A file's keys over the defaults, and settings over both; of two settings for one key the later counts.
    ///
    /// # Errors
    /// An unknown key or a value of the wrong type, with its key, where it was given, and what is known or expected. The file
    /// must do without the settings.
    pub fn layered(file: Option<&Path>, settings: &[Setting]) -> Result<Self, ConfigError> {
        let file = match file {
            Some(path) => Some((read(path)?, path)),
            None => None,
        };
        Self::laid_over_defaults(file, settings)
    }

    /// Layers of keys over the defaults, each over those before it, as a file's keys are.
    ///
    /// # Errors
    /// The dotted key that is unknown or has a value of the wrong type, and what is known or expected.
    #[cfg(feature = "study")]
    pub(crate) fn of_layers(layers: impl IntoIterator<Item = Table>) -> Result<Self, (String, String)> {
        let failed = |error: toml::ser::Error| (String::new(), error.to_string());
        let mut table = Table::try_from(Self::default()).map_err(failed)?;
        for layer in layers {
            setting::lay(&mut table, layer);
        }
        setting::config_of(table).map_err(|fault| (fault.key, fault.message))
    }

    fn laid_over_defaults(file: Option<(Table, &Path)>, settings: &[Setting]) -> Result<Self, ConfigError> {
        let mut table = Table::try_from(Self::default())?;
        if let Some((keys, path)) = file {
            setting::lay(&mut table, keys);
            setting::config_of(table.clone()).map_err(|fault| ConfigError::Parse {
                path: path.to_owned(),
                message: format!("{}: {}; {MEND}", fault.key, fault.message),
            })?;
        }
        setting::lay(&mut table, setting::table_of(settings));
        setting::config_of(table).map_err(|fault| ConfigError::Setting {
            given: fault.given(settings),
            message: format!("{}; {MEND}", fault.message),
        })
    }

    /// The file that would give this configuration. It names every key; those that have no value are comments.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        let mut text = toml::to_string_pretty(self)?;
        let table = Table::try_from(self)?;
        let mut note = |section: &str, lines: &str| {
            let header = format!("[{section}]\n");
            text = text.replacen(&header, &format!("{header}{lines}"), 1);
        };
        // Each goes to the head of its section, so that the last comes first.
        for (section, key, value, meaning) in ABSENT.into_iter().rev() {
            if table
                .get(section)
                .is_some_and(|section| section.get(key).is_none())
            {
                note(section, &format!("# {key} = {value}    # absent: {meaning}\n"));
            }
        }
        let other = match self.solver.minimiser {
            Minimiser::Lm { .. } => Minimiser::lbfgs(default_lbfgs_rank()),
            Minimiser::Lbfgs { .. } => Minimiser::lm(LinearSolver::Auto),
        };
        let keys: String = toml::to_string_pretty(&other)?
            .lines()
            .map(|line| format!("#     {line}\n"))
            .collect();
        note(
            "solver.minimiser",
            &format!("# Or the other method, with its own keys:\n{keys}"),
        );
        Ok(text)
    }
}

fn read(path: &Path) -> Result<Table, ConfigError> {
    let text = crate::files::read_text(path).map_err(|problem| ConfigError::Read {
        path: path.to_owned(),
        problem,
    })?;
    table(&text, path)
}

fn table(text: &str, path: &Path) -> Result<Table, ConfigError> {
    text.parse().map_err(|error: toml::de::Error| ConfigError::Parse {
        path: path.to_owned(),
        message: crate::image::one_line(error.message()),
    })
}

#[cfg(test)]
mod tests;
