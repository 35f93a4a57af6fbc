//! `spba-ceres solve`.

/// Recover shape and cameras from a sequence.
#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: &Args) -> anyhow::Result<()> {
    anyhow::bail!("not written yet")
}
