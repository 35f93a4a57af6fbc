//! Studies: many solves whose records make a table or a figure of the paper.
//!
//! Every solve is a job. Its record is kept in a cache, so that a study that was interrupted goes on where it stopped,
//! and studies share what they have in common. A record counts only for the build, the configuration and the input
//! that made it.

mod ablation;
mod compare;
mod fig3;
mod fig6;
mod fig7;
mod fig8;
mod jobs;
mod measures;
mod method;
mod perturbed;
mod plot;
mod subject;
mod table;
mod table1;

pub use ablation::{Ablation, ablation};
pub use compare::{
    Comparison, Iteration, JudgedState, Minimisation, MinimiserSettings, Perturbation, SettingsError, compare,
};
pub use fig3::{Fig3, fig3};
pub use fig6::{Fig6, fig6};
pub use fig7::{Fig7, fig7};
pub use fig8::{Fig8, fig8};
pub use jobs::{Jobs, StudyObserver};
pub use measures::{DepthHistogram, Measures};
pub use method::{Effort, Method};
pub use perturbed::{perturbed_pose, perturbed_start};
pub use subject::{Run, Start, Subject};
pub use table::Table;
pub use table1::{SequenceKind, Table1, table1};

use std::path::{Path, PathBuf};

/// Why a study has no result.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A file cannot be read or written.
    #[error("{}: {problem}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// A figure cannot be drawn.
    #[error("{}: cannot draw: {reason}", path.display())]
    Plot {
        /// The figure's file.
        path: PathBuf,
        /// What went wrong.
        reason: String,
    },
    /// The caller stopped the study; finished records are kept.
    #[error("interrupted; the same command goes on from here")]
    Interrupted,
    /// A sequence cannot be loaded.
    #[error("{name}: {source}")]
    Sequence {
        /// The sequence's name.
        name: String,
        /// What went wrong.
        source: Box<crate::sequence::SequenceError>,
    },
    /// The description of a turning platform cannot be used.
    #[error("{name}: {source}")]
    Platform {
        /// The sequence's name.
        name: String,
        /// What went wrong.
        source: crate::eval::PlatformError,
    },
    /// A sequence gives no starting point.
    #[error("{name}: {source}")]
    Init {
        /// The sequence's name.
        name: String,
        /// What went wrong.
        source: crate::init::InitError,
    },
    /// A method finds no solution.
    #[error("{name}: {source}")]
    Solve {
        /// The sequence's and the method's name.
        name: String,
        /// What went wrong.
        source: crate::solver::SolveError,
    },
    /// The objective cannot be evaluated.
    #[error("{name}: {source}")]
    Objective {
        /// The sequence's name.
        name: String,
        /// What went wrong.
        source: crate::objective::ObjectiveError,
    },
    /// A prior cannot be loaded.
    #[error(transparent)]
    Prior(#[from] crate::prior::PriorError),
    /// A bundled configuration cannot be read.
    #[error("a configuration that ships: {0}")]
    Shipped(#[from] toml::de::Error),
    /// A record cannot be written as JSON.
    #[error("{0}")]
    Record(#[from] serde_json::Error),
}

impl StudyError {
    fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |problem| Self::Io {
            path: path.to_owned(),
            problem,
        }
    }
}

/// Writes `text` beside `path`, then renames.
pub fn write_text(path: &Path, text: &str) -> Result<(), StudyError> {
    crate::files::write_whole(path, text.as_bytes()).map_err(StudyError::io(path))
}
