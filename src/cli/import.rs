//! `spba-ceres import`.

use super::input::{InputArgs, read};
use spba_ceres::sequence;
use std::path::PathBuf;

/// Turn a COLMAP workspace (with openMVS depth, if given) into a sequence folder.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: InputArgs,
    /// The sequence folder to make; must not exist
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let options = args.input.options()?;
    if args.out.symlink_metadata().is_ok() {
        return Err(sequence::SequenceError::TargetExists(args.out.clone()).into());
    }
    let sequence = read(&args.input.input, &options)?;
    sequence::write(&sequence, &args.out)?;
    println!(
        "{} frames written to {}",
        sequence.frames.len(),
        args.out.display()
    );
    Ok(())
}
