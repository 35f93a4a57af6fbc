//! What can be wrong with an image, mask or depth file on disk.

use std::path::{Path, PathBuf};

/// One line each: file, what is wrong, mend.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    #[error("{}: file is missing; put it there or correct its path", .0.display())]
    Missing(PathBuf),
    #[error("{}: cannot be read ({source}); check the file's permissions", .file.display())]
    Read { file: PathBuf, source: std::io::Error },
    #[error("{}: image does not decode ({reason}); export it again as PNG or JPEG", .file.display())]
    Decode { file: PathBuf, reason: String },
    #[error("{}: depth map does not decode ({reason}); export it as EXR with one f32 channel named Z", .file.display())]
    Depth { file: PathBuf, reason: String },
    #[error("{}: cannot be written ({reason}); check the free space and the folder's permissions", .file.display())]
    Write { file: PathBuf, reason: String },
}

impl ImageError {
    pub(crate) fn read(file: &Path, source: std::io::Error) -> Self {
        match source.kind() {
            std::io::ErrorKind::NotFound => Self::Missing(file.to_owned()),
            _ => Self::Read {
                file: file.to_owned(),
                source,
            },
        }
    }
}
