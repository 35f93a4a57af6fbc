//! `spba-ceres import`.

/// Turn a COLMAP workspace (with openMVS depth, if given) into a sequence folder.
#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: &Args) -> anyhow::Result<()> {
    anyhow::bail!("not written yet")
}
