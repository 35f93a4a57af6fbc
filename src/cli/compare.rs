//! `spba-ceres compare`: minimisers and strategies on one objective from the same starts.

use super::input::InputArgs;
use super::progress::StudyWatch;
use anyhow::Context;
use clap::ValueEnum;
use spba_ceres::solver::{Interpolation, LinearSolver, default_lbfgs_rank};
use spba_ceres::study::{self, Effort, Jobs, Subject};
use std::path::PathBuf;

/// Compare Levenberg-Marquardt with L-BFGS, joint with alternating, on one sequence: the same objective, the same
/// starts, the same rule for visibility.
///
/// Every state at the end of a solver call is judged at full resolution with its own visibility; the best of all is what
/// the others are measured against. Seconds are processor seconds of the one thread that solves. An interrupted run goes
/// on where it stopped.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: InputArgs,
    /// Starts: the best of the short solves, and others 5 degrees and 2 % of the distance away from it
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Histories of L-BFGS to try
    #[arg(long, value_name = "RANK", value_delimiter = ',', default_values_t = [default_lbfgs_rank()])]
    lbfgs_ranks: Vec<u32>,
    /// How L-BFGS's line search is to choose its next trial
    #[arg(long, value_name = "KIND", value_delimiter = ',', default_value = "cubic")]
    interpolations: Vec<InterpolationArg>,
    /// Linear solvers for joint LM over a residual block each, beside LM over accumulated normal equations
    #[arg(long, value_name = "SOLVER", value_delimiter = ',')]
    linear_solvers: Vec<LinearSolverArg>,
    /// Folder for compare.csv, .json, .md and charts (SVG)
    #[arg(long, default_value = "results")]
    out: PathBuf,
    /// Folder that keeps the records of solves
    #[arg(long, default_value = "out/study")]
    cache: PathBuf,
    /// Solves side by side [default: one per core]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    threads: usize,
    /// A minute instead of many: shows that all works, the figures mean nothing
    #[arg(long)]
    quick: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum LinearSolverArg {
    SparseNormalCholesky,
    DenseNormalCholesky,
}

#[derive(Clone, Copy, ValueEnum)]
enum InterpolationArg {
    Cubic,
    Quadratic,
    Bisection,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build_global()
        .context("threads")?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let name = args
        .input
        .input
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let subject = Subject::load(&name, &args.input.input, args.input.options()?)?;
    let linear_solvers: Vec<LinearSolver> = args
        .linear_solvers
        .iter()
        .map(|solver| match solver {
            LinearSolverArg::SparseNormalCholesky => LinearSolver::SparseNormalCholesky,
            LinearSolverArg::DenseNormalCholesky => LinearSolver::DenseNormalCholesky,
        })
        .collect();
    let interpolations: Vec<Interpolation> = args
        .interpolations
        .iter()
        .map(|interpolation| match interpolation {
            InterpolationArg::Cubic => Interpolation::Cubic,
            InterpolationArg::Quadratic => Interpolation::Quadratic,
            InterpolationArg::Bisection => Interpolation::Bisection,
        })
        .collect();
    let methods = study::methods(&args.lbfgs_ranks, &interpolations, &linear_solvers);
    let watch = StudyWatch::start()?;
    let jobs = Jobs::new(&args.cache.join("records"), &watch)?;
    let comparison = study::compare(&subject, &methods, args.seeds, &jobs, effort)?;
    watch.finish();
    comparison.draw(&args.out)?;
    let record = serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "meaningful": !args.quick,
        "seeds": args.seeds,
        "comparison": comparison,
    });
    let (summary, out) = (comparison.summary(), &args.out);
    study::write_text(&out.join("compare.json"), &serde_json::to_string(&record)?)?;
    study::write_text(&out.join("compare.csv"), &comparison.details().csv())?;
    study::write_text(&out.join("compare.md"), &summary.markdown())?;
    print!("{}", summary.text());
    println!("written to {}/compare*", out.display());
    Ok(())
}
