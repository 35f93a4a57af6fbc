//! What can be wrong with an input. Every message is one line: file, field, what is wrong, mend.

use crate::image::ImageError;
use std::path::{Path, PathBuf};

/// Why an input cannot be loaded or written.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// The path is no input of a known kind.
    #[error(
        "{}: no input of a known kind; give a folder with sequence.toml, a COLMAP workspace (images/, sparse/, masks/) \
         or a folder with scene.mvs, depth*.dmap, images/ and masks/", .0.display()
    )]
    NotRecognised(PathBuf),

    /// An image, mask or depth file cannot be used.
    #[error(transparent)]
    Image(#[from] ImageError),

    // Not `source`, here and below: the message has it already, and whoever prints the chain would print it twice.
    /// A file cannot be read.
    #[error("{}: cannot be read ({problem}); check that it exists and its permissions", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },

    /// A file or folder that the input needs is not there.
    #[error("{}: {what} is missing; {mend}", .file.display())]
    Missing {
        /// The file or folder that is missing, or the one that should name it.
        file: PathBuf,
        /// What is missing.
        what: String,
        /// How to mend it.
        mend: String,
    },

    /// A value that is there but wrong.
    #[error("{}: {field}: {problem}; {mend}", .file.display())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The key, line or entry.
        field: String,
        /// What is wrong with its value.
        problem: String,
        /// How to mend it.
        mend: String,
    },

    /// A binary file that ends inside `field`.
    #[error("{}: {field}: file is truncated ({needed} more bytes needed at byte {at}); copy or export it again", .file.display())]
    Truncated {
        /// The file.
        file: PathBuf,
        /// What was being read.
        field: String,
        /// The byte at which the file ends too early.
        at: usize,
        /// The bytes that are missing at least.
        needed: u64,
    },

    /// A mask or depth map has another size than its frame.
    #[error("{}: {what} is {} × {}, but the frame is {} × {}; {mend}", .file.display(), .found.0, .found.1, .expected.0, .expected.1)]
    Size {
        /// The file.
        file: PathBuf,
        /// What it is, in words: a mask or a depth map.
        what: String,
        /// Its (width, height) in pixels.
        found: (usize, usize),
        /// The frame's (width, height) in pixels.
        expected: (usize, usize),
        /// How to mend it.
        mend: String,
    },

    /// No pixel of the mask is above 127. The field is the mask's file.
    #[error("{}: mask is empty (no pixel above 127); paint the object white or drop the frame", .0.display())]
    EmptyMask(PathBuf),

    /// Fewer than two frames are left.
    #[error("{}: frames: {count} left, at least two are needed; {mend}", .file.display())]
    TooFewFrames {
        /// The file that lists the frames.
        file: PathBuf,
        /// The frames that are left.
        count: usize,
        /// How to get more.
        mend: String,
    },

    /// Two places that should name the same number of things.
    #[error("{}: {field}: says {declared}, but there are {found}; {mend}", .file.display())]
    CountMismatch {
        /// The file with the declaration.
        file: PathBuf,
        /// What is counted.
        field: String,
        /// The number that the file declares.
        declared: u64,
        /// The number found.
        found: u64,
        /// How to mend it.
        mend: String,
    },

    /// A COLMAP camera has a model that is not read here.
    #[error("{}: camera model: `{model}` is unknown; convert the camera to one of {known}", .file.display())]
    UnknownCameraModel {
        /// The file with the cameras.
        file: PathBuf,
        /// The model's name or number.
        model: String,
        /// The models that are read.
        known: String,
    },

    /// The file is openMVS's internal archive. The field is its path.
    #[error(
        "{}: format: this is openMVS's internal archive (MVS\\0); export the interface format instead: \
         InterfaceCOLMAP writes it, or `DensifyPointCloud --archive-type 0`", .0.display()
    )]
    OpenMvsArchive(PathBuf),

    /// The distortion of a camera cannot be removed.
    #[error("{}: camera model: {reason}", .file.display())]
    Undistort {
        /// The file with the cameras.
        file: PathBuf,
        /// Why, and how to mend it.
        reason: String,
    },

    /// The folder to write exists already. The field is its path.
    #[error("{}: output folder is in use; name one that does not exist yet", .0.display())]
    TargetExists(PathBuf),

    /// A file cannot be written.
    #[error("{}: cannot be written ({problem}); check the free space and the folder's permissions", .file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
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
