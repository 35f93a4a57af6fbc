//! `spba-ceres inspect`.

/// Say what a sequence holds and what is wrong with it, without solving.
#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: &Args) -> anyhow::Result<()> {
    anyhow::bail!("not written yet")
}
