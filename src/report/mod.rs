//! The result folder: shape, cameras, depth maps, overlays, trace, `result.json`, and all of it to look at in `report.html`.
//!
//! [`write`] turns a [`Solution`](crate::solver::Solution) into files, [`RunResult::load`] and [`read_shape`] read
//! them back, [`write_page`] makes the page anew; [`Surface`] says what the shape looks like in a camera.

mod colmap;
mod colormap;
mod colour;
mod doubts;
mod exposure;
mod folder;
mod glb;
mod lettering;
mod overlap;
mod overlay;
mod page;
mod ply;
#[cfg(feature = "rerun")]
mod recording;
mod result;
mod review;
mod sheet;
mod surface;
mod texture;
mod trace;
mod trajectory;
mod write;

#[cfg(test)]
pub(crate) mod fixture;

pub use crate::memory::{forget_peak_memory, peak_memory_mb};
use doubts::style_length;
pub use doubts::{Doubts, doubts};
pub use folder::{check_out, file_stems};
pub use overlap::{density, hole_share, outside_share, silhouette_iou};
pub use page::{as_solved, write_page};
pub use ply::read_shape;
#[cfg(feature = "rerun")]
pub use recording::write_recording;
pub use result::{FrameResult, ObjectiveSpan, RunResult, SimilarityRecord};
pub use review::write_review;
pub use surface::{Surface, UnwrappedMesh, ZBuffer};
pub use write::{ReportInput, Written, write};

use std::path::{Path, PathBuf};

/// Why a result folder could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The result folder exists already.
    #[error("{}: exists already; name another --out or remove it", path.display())]
    OutputExists {
        /// The folder.
        path: PathBuf,
    },
    // Not `source`: the message has it already, and whoever prints the chain would print it twice.
    /// A file of the result folder cannot be read or written.
    #[error("{}: {problem}; check the path, the free space and the permissions", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// A picture, mask or depth file cannot be read or written.
    #[error(transparent)]
    Image(#[from] crate::image::ImageError),
    /// A file of a result folder is damaged.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and how to mend it.
        message: String,
    },
    /// A value of the solution is infinite or not a number.
    #[error("{field} is not a finite number; nothing was written")]
    NotFinite {
        /// The value's name.
        field: String,
    },
    /// The solution has not one pose per frame.
    #[error("the solution has {poses} camera poses for {frames} frames; nothing was written")]
    FrameCount {
        /// The frames of the sequence.
        frames: usize,
        /// The poses of the solution.
        poses: usize,
    },
    /// The shape has no point.
    #[error("the shape has no points; nothing was written")]
    EmptyShape,
    /// α is beyond what an input's unit can be.
    #[error(
        "alpha is {alpha:e}, which is no scale (1e-9 to 1e9 are); nothing was written: check the input's poses and depth"
    )]
    NoScale {
        /// α of the solution.
        alpha: f64,
    },
    /// A camera is so far away that the solve must have diverged.
    #[error(
        "the camera of frame {frame} is {away:e} diagonals away; nothing was written: check the input's poses and masks"
    )]
    FarAway {
        /// The frame's name.
        frame: String,
        /// The camera's distance from the object, diagonals.
        away: f64,
    },
}

impl ReportError {
    fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |problem| Self::Io {
            path: path.to_owned(),
            problem,
        }
    }

    fn format(path: &Path, message: impl std::fmt::Display) -> Self {
        Self::Format {
            path: path.to_owned(),
            message: message.to_string(),
        }
    }
}
