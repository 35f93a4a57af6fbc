//! Why a prior file cannot be used.

use super::{METADATA_KEY, SCHEMA, SURFACE_SCHEMA};
use crate::geometry::OBJECT_FRAME;
use crate::prior::linear::InvalidPrior;
use std::path::PathBuf;

/// Why a prior file cannot be used or written; each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum PriorError {
    /// The file cannot be read.
    #[error("{}: cannot read the prior: {problem}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot write the prior: {problem}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// No bundled prior has this name, and no file has this path.
    #[error(
        "prior `{name}` is neither bundled ({bundled}) nor a file: give one of those names or a path to a .safetensors file"
    )]
    Unknown {
        /// The name or path that was given.
        name: String,
        /// The names of the bundled priors.
        bundled: String,
    },
    /// Priors that are to compete are of different categories. The fields are two of them.
    #[error("priors of {0} and {1}: give priors of one category")]
    Categories(String, String),
    /// The file is no whole safetensors file.
    #[error("{}: not a whole safetensors file ({reason}): download or learn it again", path.display())]
    NotSafetensors {
        /// The file.
        path: PathBuf,
        /// The parser's error.
        reason: String,
    },
    /// The file's metadata does not describe a prior.
    #[error("{}: not a shape prior (metadata `{METADATA_KEY}` {reason}): make one with `spba-ceres prior learn`", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// The file has a schema that this build does not read.
    #[error("{}: prior schema {found}, this build reads {SCHEMA} and {SURFACE_SCHEMA}: learn the prior again with this version", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The schema of the file.
        found: u64,
    },
    /// The file's object frame is not that of this library.
    #[error("{}: object frame `{found}`, this build's is `{OBJECT_FRAME}`: learn the prior again with this version", path.display())]
    Frame {
        /// The file.
        path: PathBuf,
        /// The frame in the file's words.
        found: String,
    },
    /// A tensor is missing, or has another type or shape.
    #[error("{}: tensor `{tensor}` {reason}: learn the prior again", path.display())]
    Tensor {
        /// The file.
        path: PathBuf,
        /// The tensor's name.
        tensor: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The file's numbers do not make a prior.
    #[error("{}: {problem}: learn the prior again", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        problem: InvalidPrior,
    },
    /// The mean shape is not in the unit and the frame of a prior.
    #[error("{}: the mean shape's {what} is {found:.3}, {expected} expected, as shapes are in diagonals of their box about its centre: \
             scale or move it, or learn the prior again", path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The measure of the mean shape that is out of range, in words.
        what: &'static str,
        /// Its value.
        found: f64,
        /// The range that it must lie in.
        expected: &'static str,
    },
    /// The prior is not mirror-symmetric although its description says so. The field is a point that is not the mirror image of its partner.
    #[error("the prior is not symmetric in x = 0 at point {0}, though its description says so")]
    NotSymmetric(usize),
}
