//! `spba-ceres render`.

/// Render a sequence with full ground truth from a CAD model.
#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: &Args) -> anyhow::Result<()> {
    anyhow::bail!("not written yet")
}
