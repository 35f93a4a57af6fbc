//! Why an input cannot be prepared. One line each: what, why, mend.

use super::masks::NetworkError;
use super::motion::StructureFromMotionError;
use crate::image::ImageError;
use crate::sequence::SequenceError;
use std::path::PathBuf;

/// Why pictures or a video cannot be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// The input does not exist. The field is its path.
    #[error("{}: no such file or folder; correct its path", .0.display())]
    Missing(PathBuf),
    // Not `source`: the message has it already, and whoever prints the chain would print it twice.
    /// A file of the input cannot be read.
    #[error("{}: cannot be read ({problem}); check its permissions", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// OpenCV cannot decode the file as a video. The field is its path.
    #[error("{}: no video that OpenCV can decode; export it again as MP4 (H.264), or give a folder of its frames", .0.display())]
    NoVideo(PathBuf),
    /// The folder holds no picture. The field is its path.
    #[error("{}: no pictures; give a folder of PNG or JPEG pictures of one object, or a video", .0.display())]
    NoPictures(PathBuf),
    /// Fewer than two frames are left.
    #[error("{}: {found} frames, at least two are needed; {mend}", .input.display())]
    TooFew {
        /// The video or the folder.
        input: PathBuf,
        /// The frames found.
        found: usize,
        /// How to get more frames.
        mend: String,
    },
    /// The pictures differ in size.
    #[error("{}: {} × {} pixels, but most are {} × {}; leave it out or scale it", .file.display(), .found.0, .found.1, .expected.0, .expected.1)]
    MixedSizes {
        /// The picture that differs from most.
        file: PathBuf,
        /// Its (width, height) in pixels.
        found: (usize, usize),
        /// The (width, height) of most pictures.
        expected: (usize, usize),
    },
    /// An option is out of range or contradicts the input.
    #[error("{option}: {problem}; {mend}")]
    Option {
        /// The option as on the command line.
        option: &'static str,
        /// What is wrong with its value.
        problem: String,
        /// What to give instead.
        mend: &'static str,
    },
    /// Too few frames show an object.
    #[error(
        "frames: an object was found in {found} of {frames} only; give --networks, --box x,y,w,h or --masks"
    )]
    NoObject {
        /// The frames in which an object was found.
        found: usize,
        /// The frames that were looked at.
        frames: usize,
    },
    /// A network cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// A picture, mask or depth file cannot be read or written.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// No camera motion was found.
    #[error(transparent)]
    Motion(StructureFromMotionError),
    /// The prepared frames do not make a sequence.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// OpenCV threw an exception. The field is its message.
    #[error("OpenCV: {0}")]
    OpenCv(String),
    /// The caller stopped the work; no sequence was written.
    #[error("interrupted: nothing was written")]
    Interrupted,
}

impl From<StructureFromMotionError> for PrepareError {
    fn from(error: StructureFromMotionError) -> Self {
        match error {
            StructureFromMotionError::Interrupted => Self::Interrupted,
            error => Self::Motion(error),
        }
    }
}

impl From<cxx::Exception> for PrepareError {
    fn from(error: cxx::Exception) -> Self {
        Self::OpenCv(crate::image::one_line(error.what()))
    }
}
