//! The methods that studies compare, as configurations.

use super::StudyError;
use crate::config::Config;
use crate::solver::{Minimiser, Strategy, default_lbfgs_rank};
use serde::Serialize;

const PAPER: &str = include_str!("../../data/paper.toml");
const ZHU: &str = include_str!("../../data/zhu.toml");

/// A name and all that decides what the method does.
#[derive(Clone, Debug, Serialize)]
pub struct Method {
    /// Short, for files.
    pub name: String,
    /// The name in tables and figures.
    pub label: String,
    /// The configuration that is the method.
    pub config: Config,
}

/// How much work a study does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Everything, as in the paper's tables.
    Full,
    /// Minutes, to see that all works; the figures mean nothing.
    Quick,
}

impl Method {
    /// A method of this file name, label and configuration.
    pub fn new(name: &str, label: &str, config: Config) -> Self {
        Self {
            name: name.to_owned(),
            label: label.to_owned(),
            config,
        }
    }

    /// This library's defaults.
    pub fn ours() -> Self {
        Self::new("ours", "ours", Config::default())
    }

    /// The defaults but for Algorithm 1's order and L-BFGS.
    pub fn ours_alternating_lbfgs() -> Self {
        let mut config = Config::default();
        config.solver.strategy = Strategy::Alternating;
        config.solver.minimiser = Minimiser::lbfgs(default_lbfgs_rank());
        Self::new("ours-lbfgs", "ours, alternating L-BFGS", config)
    }

    /// The method as the paper describes it: `data/paper.toml`.
    pub fn paper() -> Result<Self, StudyError> {
        let config = toml::from_str(PAPER)?;
        Ok(Self::new("paper", "as in the paper", config))
    }

    /// Zhu et al.: `data/zhu.toml`.
    pub fn zhu() -> Result<Self, StudyError> {
        Ok(Self::new("zhu", "Zhu et al.", toml::from_str(ZHU)?))
    }

    /// The same, with less work where `effort` says so.
    pub fn with(mut self, effort: Effort) -> Self {
        if effort == Effort::Quick {
            let Config {
                objective, solver, ..
            } = &mut self.config;
            objective.points = 1024;
            objective.silhouette_pixels = 500;
            objective.silhouette_points = 500;
            solver.max_steps = 2;
            solver.iterations_per_call = Some(5);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_configurations_are_valid_and_not_the_defaults() {
        for method in [Method::paper(), Method::zhu()] {
            let config = method.unwrap().config;
            config.objective.check().unwrap();
            config.solver.check().unwrap();
            assert_ne!(config, Config::default());
        }
    }
}
