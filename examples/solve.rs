//! Solves a sequence folder with little effort and writes the result folder.
//!
//! `cargo run --release --example solve [SEQUENCE [OUT]]`; the bundled car goes to `out/example` by default.

use spba_ceres::config::Config;
use spba_ceres::objective::Footage;
use spba_ceres::prior::{self, ShapePrior};
use spba_ceres::report::{self, ReportInput, Surface};
use spba_ceres::{init, sequence, solver};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Keys that make a solve a matter of seconds. Without them it takes longer and is more accurate.
const LITTLE_EFFORT: &str = "
init = { points = 512, hypotheses = { count = 1 } }
objective = { points = 1024 }
solver = { max_steps = 3, levels = 1, free_form = 'none' }
";

pub fn run(input: &Path, out: &Path) -> Result<(), Box<dyn Error>> {
    let config = Config::parse(LITTLE_EFFORT, Path::new("little effort"))?;
    let sequence = sequence::load(input, &config.input.load_options()?)?;
    let (learned, info) = prior::open(&config.prior)?;
    let prior: Arc<dyn ShapePrior> = Arc::new(learned.clone());
    let target = config.input.target_of(sequence.frames.len())?;
    let mean = vec![0.0; prior.style_len()];
    let starts = init::initialise(&sequence, prior.as_ref(), &mean, target, &config.init)?;

    let footage = Footage::new(&sequence, config.solver.levels)?;
    let (objective, options) = (&config.objective, &config.solver);
    // The observer sees every iteration; false stops the solve and keeps the best state.
    let solution = solver::solve(&footage, &prior, target, &starts, objective, options, &|_| true)?;

    let report = ReportInput {
        sequence: &sequence,
        solution: &solution,
        surface: &Surface::of(&learned, &solution),
        input: &input.display().to_string(),
        prior: &info.category,
        length_m: config.output.length_m,
        masks_anew: &[],
        config: &config.to_toml()?,
        focal_deviation: config.objective.focal_deviation.unwrap_or(0.0),
        peak_memory_mb: report::peak_memory_mb(),
    };
    println!("{}", report::write(&report, out)?.page.display());
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let input = arguments.next().unwrap_or("data/sequences/car".into());
    let out = arguments.next().unwrap_or("out/example".into());
    run(Path::new(&input), Path::new(&out))
}
