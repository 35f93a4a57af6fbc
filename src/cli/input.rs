//! How verbs name an input: INPUT, `--depth`, `--frames`, `--every`; and how they find a result's input again.

use anyhow::ensure;
use spba_ceres::config::Config;
use spba_ceres::report::RunResult;
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

/// The sequence folder that `solve` makes of a video or pictures: beside the result, under the input's name.
pub fn made_beside(result: &Path, input: &Path) -> PathBuf {
    let mut name = input.file_name().unwrap_or_default().to_owned();
    name.push(".sequence");
    result.with_file_name(name)
}

/// The input that the result in `folder` was solved from, read as it was read then. A relative path counts from the
/// current folder, as it did for `solve`.
pub fn solved_from(folder: &Path, result: &RunResult) -> anyhow::Result<Sequence> {
    let mut input = PathBuf::from(&result.input);
    if !sequence::recognises(&input) {
        // Absolute, since `.` has no name that another could stand beside.
        let made = made_beside(&folder.canonicalize()?, &input);
        ensure!(
            made.is_dir(),
            "{}, its input, is not there any more, or not from this folder; go to where solve was run, or give --input",
            input.display()
        );
        input = made;
    }
    let options = Config::load(&folder.join("config.toml"))?.input.load_options()?;
    let sequence = sequence::load(&input, &options)?;
    holds_frames(&sequence, &input, result)?;
    Ok(sequence)
}

/// Fails unless every frame of `result` is in `sequence`, read from `input`.
pub fn holds_frames(sequence: &Sequence, input: &Path, result: &RunResult) -> anyhow::Result<()> {
    let known = |name: &str| sequence.frames.iter().any(|frame| frame.name == name);
    let missing = result.frames.iter().find(|frame| !known(&frame.name));
    match missing {
        None => Ok(()),
        Some(frame) => anyhow::bail!("{} has no frame {} of the result", input.display(), frame.name),
    }
}
