//! `spba-ceres report`.

use super::input::{holds_frames, read, solved_from};
use spba_ceres::config::Config;
use spba_ceres::report::{RunResult, as_solved, write_page};
use std::path::PathBuf;

/// Make a result's page (report.html) anew, from the result folder and the sequence that it was solved from.
///
/// The page is one file that holds all it needs: open it in a browser, from disk or sent to somebody.
#[derive(clap::Args)]
pub struct Args {
    /// Result folder of `solve`
    result: PathBuf,
    /// What the result was solved from, where it lies elsewhere now [default: the input that the result names]
    #[arg(long, value_name = "SEQUENCE")]
    input: Option<PathBuf>,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let folder = &args.result;
    let result = RunResult::load(folder)?;
    let config = Config::load(&folder.join("config.toml"))?;
    let sequence = match &args.input {
        Some(input) => {
            let sequence = read(input, &config.input.load_options()?)?;
            holds_frames(&sequence, input, &result)?;
            sequence
        }
        None => solved_from(folder, &result)?,
    };
    let sequence = as_solved(sequence, folder, &result)?;
    let focal_deviation = config.objective.focal_deviation.unwrap_or(0.0);
    let written = write_page(folder, &sequence, focal_deviation)?;
    for words in &written.words {
        println!("IN DOUBT         {words}");
    }
    println!("report           {}", folder.join("report.html").display());
    Ok(())
}
