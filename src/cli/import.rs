//! `spba-ceres import`.

use super::input::{InputArgs, read};
use spba_ceres::sequence::{self, LoadOptions};
use std::path::PathBuf;

/// Turn a COLMAP workspace (with openMVS depth, if given) into a sequence folder.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: InputArgs,
    /// The rendered sequence that the images are from: its truth goes along, so that a solve from these poses and depth
    /// can be measured
    #[arg(long, value_name = "SEQUENCE")]
    truth: Option<PathBuf>,
    /// The sequence folder to make; must not exist
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let options = args.input.options()?;
    if args.out.symlink_metadata().is_ok() {
        return Err(sequence::SequenceError::TargetExists(args.out.clone()).into());
    }
    let mut sequence = read(&args.input.input, &options)?;
    if let Some(truth) = &args.truth {
        sequence = sequence.with_truth_of(&sequence::load(truth, &LoadOptions::default())?, truth)?;
    }
    sequence::write(&sequence, &args.out)?;
    println!(
        "{} frames written to {}",
        sequence.frames.len(),
        args.out.display()
    );
    Ok(())
}
