//! How verbs name an input: INPUT, `--depth`, `--frames`, `--every`.

use spba_ceres::sequence::{FrameWindow, LoadOptions, WindowError};
use std::path::PathBuf;

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
