//! What can go wrong with a CAD file.

use std::path::{Path, PathBuf};

/// Every message names the file, the place in it, and what would mend it.
#[derive(Debug, thiserror::Error)]
pub enum CadError {
    /// The file cannot be read.
    #[error("{}: cannot read: {problem}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        // Not `source`: the message has it already, and a chain would print it twice.
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The file is damaged or holds something that this reader refuses.
    #[error("{}: {place}: {problem}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, key or block.
        place: String,
        /// What is wrong there, and how to mend it.
        problem: String,
    },
    /// The file's extension is that of no format that is read here. The field is the file's path.
    #[error("{}: not a CAD file that is read here; give an AC3D (.ac, .acc), Wavefront (.obj) or binary glTF (.glb) file", .0.display())]
    UnknownFormat(PathBuf),
    /// A source of models cannot be used.
    #[error("{}: {problem}", path.display())]
    Source {
        /// The root of the source.
        path: PathBuf,
        /// What is wrong with it, and how to mend it.
        problem: String,
    },
    /// A value of a scene file is out of range.
    #[error("{field}: {problem}")]
    Scene {
        /// The key in the scene file.
        field: &'static str,
        /// What is wrong with the value, and how to mend it.
        problem: String,
    },
    /// Blender is not installed or failed. The field holds its last words.
    #[error("blender: {0}")]
    Blender(String),
    /// The rendered frames do not make a sequence.
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
