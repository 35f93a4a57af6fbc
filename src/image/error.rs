//! What can be wrong with an image, mask or depth file on disk.

use std::path::{Path, PathBuf};

/// Why an image, mask or depth file cannot be used. Every message is one line: file, what is wrong, mend.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file does not exist. The field is its path.
    #[error("{}: file is missing; put it there or correct its path", .0.display())]
    Missing(PathBuf),
    // Not `source`, here and below: the message has it already, and whoever prints the chain would print it twice.
    /// The file exists and cannot be read.
    #[error("{}: cannot be read ({problem}); check the file's permissions", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The file is no PNG or JPEG image that can be decoded.
    #[error("{}: image does not decode ({reason}); copy it again, or export it as PNG or JPEG", .file.display())]
    Decode {
        /// The file.
        file: PathBuf,
        /// The decoder's error.
        reason: String,
    },
    /// The file is an image, but no mask of an object.
    #[error("{}: no mask of an object: {problem}; paint the object white and all else black", .file.display())]
    Mask {
        /// The file.
        file: PathBuf,
        /// What speaks against it.
        problem: String,
    },
    /// The file is no depth map in EXR.
    #[error("{}: depth map does not decode ({reason}); export it as EXR with one f32 channel named Z", .file.display())]
    Depth {
        /// The file.
        file: PathBuf,
        /// The decoder's error, or what the file lacks.
        reason: String,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written ({problem}); check the free space and the folder's permissions", .file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
}

impl ImageError {
    pub(crate) fn read(file: &Path, problem: std::io::Error) -> Self {
        match problem.kind() {
            std::io::ErrorKind::NotFound => Self::Missing(file.to_owned()),
            _ => Self::Read {
                file: file.to_owned(),
                problem,
            },
        }
    }
}
