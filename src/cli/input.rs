//! How verbs name an input: INPUT, `--depth`, `--frames`, `--every`.

use spba_ceres::sequence::{self, FrameWindow, LoadOptions, Sequence, SequenceError, WindowError};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct InputArgs {
    /// A sequence folder, a COLMAP workspace (images/, sparse/, masks/) or an openMVS project
    pub input: PathBuf,
    /// Folder with openMVS's scene.mvs and depth*.dmap, for a COLMAP workspace
    #[arg(long, value_name = "FOLDER")]
    depth: Option<PathBuf>,
    /// Frames to use, by index in name order, end exclusive: 0..16, 4.., ..16
    #[arg(long, value_name = "RANGE", default_value = "..")]
    frames: String,
    /// Use every n-th of those frames
    #[arg(long, value_name = "N", default_value_t = 1)]
    every: usize,
}

impl InputArgs {
    pub fn options(&self) -> Result<LoadOptions, WindowError> {
        Ok(LoadOptions {
            depth: self.depth.clone(),
            window: FrameWindow::parse(&self.frames, self.every)?,
        })
    }
}

/// Reads an input; what is merely worth knowing about it goes to standard error.
pub fn read(input: &Path, options: &LoadOptions) -> Result<Sequence, SequenceError> {
    let examination = sequence::examine(input, options)?;
    for note in &examination.notes {
        eprintln!("note: {note}");
    }
    examination.into_sequence()
}
