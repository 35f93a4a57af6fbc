//! What can go wrong with a CAD file.

use std::path::{Path, PathBuf};

/// Every message names the file, the place in it, and what would mend it.
#[derive(Debug, thiserror::Error)]
pub enum CadError {
    #[error("{}: cannot read: {problem}", path.display())]
    Read {
        path: PathBuf,
        // Not `source`: the message has it already, and a chain would print it twice.
        problem: std::io::Error,
    },
    #[error("{}: {place}: {problem}", path.display())]
    Malformed {
        path: PathBuf,
        /// Line, key or block.
        place: String,
        problem: String,
    },
    #[error("{}: not a CAD file that is read here; give an AC3D (.ac, .acc), Wavefront (.obj) or binary glTF (.glb) file", .0.display())]
    UnknownFormat(PathBuf),
    #[error("{}: {problem}", path.display())]
    Source {
        /// The root of the source.
        path: PathBuf,
        problem: String,
    },
    #[error("{field}: {problem}")]
    Scene {
        /// Of the scene file.
        field: &'static str,
        problem: String,
    },
    #[error("blender: {0}")]
    Blender(String),
    #[error(transparent)]
    Sequence(#[from] crate::sequence::SequenceError),
}

impl CadError {
    pub(crate) fn malformed(
        path: &Path,
        place: impl std::fmt::Display,
        problem: impl std::fmt::Display,
    ) -> Self {
        Self::Malformed {
            path: path.to_owned(),
            place: place.to_string(),
            problem: problem.to_string(),
        }
    }

    pub(crate) fn source(path: &Path, problem: impl std::fmt::Display) -> Self {
        Self::Source {
            path: path.to_owned(),
            problem: problem.to_string(),
        }
    }
}
