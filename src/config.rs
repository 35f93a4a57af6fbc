//! The configuration of one run, as TOML: what `--config` reads and what a result folder keeps.

use crate::init::InitOptions;
use crate::objective::ObjectiveOptions;
use crate::sequence::{FrameWindow, LoadOptions, WindowError};
use crate::solver::SolverOptions;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Everything that decides a result besides the input's files. Every key has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// A bundled prior's name, or the path of a prior file.
    pub prior: String,
    /// Threads over pose hypotheses; 0 = one per core. The result does not depend on it.
    pub threads: usize,
    pub input: InputOptions,
    /// Where the style and the poses start.
    pub start: StartOptions,
    pub init: InitOptions,
    pub objective: ObjectiveOptions,
    pub solver: SolverOptions,
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
    /// shares the most with all others.
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

    pub fn load_options(&self) -> Result<LoadOptions, WindowError> {
        Ok(LoadOptions {
            depth: self.depth.clone(),
            window: FrameWindow::parse(&self.frames, self.every)?,
        })
    }
}

/// No such target frame.
#[derive(Debug, thiserror::Error)]
#[error("target {target}: there are {frames} frames in use; give 0 to {}", frames - 1)]
pub struct TargetError {
    target: usize,
    frames: usize,
}

/// Why a configuration file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("{}: cannot read the configuration: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: {message}", path.display())]
    Parse { path: PathBuf, message: String },
}

impl Config {
    /// Reads a TOML file; unknown keys are errors.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
        toml::from_str(&text).map_err(|error| ConfigError::Parse {
            path: path.to_owned(),
            message: crate::image::one_line(error.message()),
        })
    }

    /// The file that would give this configuration.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string_pretty(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_written_configuration_reads_back() {
        let mut config = Config::default();
        config.solver.minimiser = crate::solver::Minimiser::lbfgs(7);
        config.input.frames = "0..16".into();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.toml");
        std::fs::write(&path, config.to_toml().unwrap()).unwrap();
        assert_eq!(Config::load(&path).unwrap(), config);
    }

    #[test]
    fn unknown_keys_are_errors_on_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.toml");
        std::fs::write(&path, "[solver]\nsteps = 3\n").unwrap();
        let message = Config::load(&path).unwrap_err().to_string();
        assert!(message.contains("steps") && !message.contains('\n'), "{message}");
    }
}
