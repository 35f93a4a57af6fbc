//! What can be wrong with an input. Every message is one line: file, field, what is wrong, mend.

use crate::image::ImageError;
use std::path::{Path, PathBuf};

#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    #[error(
        "{}: no input of a known kind; give a folder with sequence.toml, a COLMAP workspace (images/, sparse/, masks/) \
         or a folder with scene.mvs, depth*.dmap, images/ and masks/", .0.display()
    )]
    NotRecognised(PathBuf),

    #[error(transparent)]
    Image(#[from] ImageError),

    // Not `source`, here and below: the message has it already, and whoever prints the chain would print it twice.
    #[error("{}: cannot be read ({problem}); check that it exists and its permissions", .file.display())]
    Read { file: PathBuf, problem: std::io::Error },

    /// A file or folder that the input needs is not there.
    #[error("{}: {what} is missing; {mend}", .file.display())]
    Missing {
        file: PathBuf,
        what: String,
        mend: String,
    },

    /// A value that is there but wrong.
    #[error("{}: {field}: {problem}; {mend}", .file.display())]
    Invalid {
        file: PathBuf,
        field: String,
        problem: String,
        mend: String,
    },

    /// A binary file that ends inside `field`.
    #[error("{}: {field}: file is truncated ({needed} more bytes needed at byte {at}); copy or export it again", .file.display())]
    Truncated {
        file: PathBuf,
        field: String,
        at: usize,
        needed: u64,
    },

    #[error("{}: {what} is {} × {}, but the frame is {} × {}; {mend}", .file.display(), .found.0, .found.1, .expected.0, .expected.1)]
    Size {
        file: PathBuf,
        what: String,
        found: (usize, usize),
        expected: (usize, usize),
        mend: String,
    },

    #[error("{}: mask is empty (no pixel above 127); paint the object white or drop the frame", .0.display())]
    EmptyMask(PathBuf),

    #[error("{}: frames: {count} left, at least two are needed; {mend}", .file.display())]
    TooFewFrames {
        file: PathBuf,
        count: usize,
        mend: String,
    },

    /// Two places that should name the same number of things.
    #[error("{}: {field}: says {declared}, but there are {found}; {mend}", .file.display())]
    CountMismatch {
        file: PathBuf,
        field: String,
        declared: u64,
        found: u64,
        mend: String,
    },

    #[error("{}: camera model: `{model}` is unknown; convert the camera to one of {known}", .file.display())]
    UnknownCameraModel {
        file: PathBuf,
        model: String,
        known: String,
    },

    #[error(
        "{}: format: this is openMVS's internal archive (MVS\\0); export the interface format instead: \
         InterfaceCOLMAP writes it, or `DensifyPointCloud --archive-type 0`", .0.display()
    )]
    OpenMvsArchive(PathBuf),

    #[error("{}: camera model: {reason}", .file.display())]
    Undistort { file: PathBuf, reason: String },

    #[error("{}: output folder is in use; name one that does not exist yet", .0.display())]
    TargetExists(PathBuf),

    #[error("{}: cannot be written ({problem}); check the free space and the folder's permissions", .file.display())]
    Write { file: PathBuf, problem: std::io::Error },
}

impl SequenceError {
    pub(crate) fn read(file: &Path, problem: std::io::Error) -> Self {
        match problem.kind() {
            std::io::ErrorKind::InvalidData => {
                Self::invalid(file, "text", "not in UTF-8", "save it in UTF-8")
            }
            _ => Self::Read {
                file: file.to_owned(),
                problem,
            },
        }
    }

    pub(crate) fn write(file: &Path, problem: std::io::Error) -> Self {
        Self::Write {
            file: file.to_owned(),
            problem,
        }
    }

    pub(crate) fn invalid(
        file: &Path,
        field: impl Into<String>,
        problem: impl Into<String>,
        mend: impl Into<String>,
    ) -> Self {
        Self::Invalid {
            file: file.to_owned(),
            field: field.into(),
            problem: problem.into(),
            mend: mend.into(),
        }
    }
}
