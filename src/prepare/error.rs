//! Why an input cannot be prepared. One line each: what, why, mend.

use super::masks::NetworkError;
use super::motion::StructureFromMotionError;
use crate::image::ImageError;
use crate::sequence::SequenceError;
use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    #[error("{}: no such file or folder; correct its path", .0.display())]
    Missing(PathBuf),
    // Not `source`: the message has it already, and whoever prints the chain would print it twice.
    #[error("{}: cannot be read ({problem}); check its permissions", .file.display())]
    Read { file: PathBuf, problem: std::io::Error },
    #[error("{}: no video that OpenCV can decode; export it again as MP4 (H.264), or give a folder of its frames", .0.display())]
    NoVideo(PathBuf),
    #[error("{}: no pictures; give a folder of PNG or JPEG pictures of one object, or a video", .0.display())]
    NoPictures(PathBuf),
    #[error("{}: {found} frames, at least two are needed; {mend}", .input.display())]
    TooFew {
        input: PathBuf,
        found: usize,
        mend: String,
    },
    #[error("{}: {} × {} pixels, but most are {} × {}; leave it out or scale it", .file.display(), .found.0, .found.1, .expected.0, .expected.1)]
    MixedSizes {
        file: PathBuf,
        found: (usize, usize),
        expected: (usize, usize),
    },
    #[error("{option}: {problem}; {mend}")]
    Option {
        option: &'static str,
        problem: String,
        mend: &'static str,
    },
    #[error(
        "frames: an object was found in {found} of {frames} only; give --networks, --box x,y,w,h or --masks"
    )]
    NoObject { found: usize, frames: usize },
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Motion(StructureFromMotionError),
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    #[error("OpenCV: {0}")]
    OpenCv(String),
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
