//! What can be wrong with an image, mask or depth file on disk.

use std::path::{Path, PathBuf};

/// One line each: file, what is wrong, mend.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    #[error("{}: file is missing; put it there or correct its path", .0.display())]
    Missing(PathBuf),
    // Not `source`, here and below: the message has it already, and whoever prints the chain would print it twice.
    #[error("{}: cannot be read ({problem}); check the file's permissions", .file.display())]
    Read { file: PathBuf, problem: std::io::Error },
    #[error("{}: image does not decode ({reason}); copy it again, or export it as PNG or JPEG", .file.display())]
    Decode { file: PathBuf, reason: String },
    #[error("{}: no mask of an object: {problem}; paint the object white and all else black", .file.display())]
    Mask { file: PathBuf, problem: String },
    #[error("{}: depth map does not decode ({reason}); export it as EXR with one f32 channel named Z", .file.display())]
    Depth { file: PathBuf, reason: String },
    #[error("{}: cannot be written ({problem}); check the free space and the folder's permissions", .file.display())]
    Write { file: PathBuf, problem: std::io::Error },
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
