//! Verbs of `spba-ceres`: parse, call the library, print.

mod batch;
mod compare;
mod eval;
mod import;
mod input;
mod inspect;
#[cfg(feature = "vision")]
mod prepare;
mod prior;
mod progress;
mod regressor;
mod render;
mod report;
mod reproduce;
mod solve;
mod starts;
mod summary;

use clap::{Parser, Subcommand};
use std::io::IsTerminal;
use std::process::ExitCode;

/// Semantic photometric bundle adjustment: from a short video of one object of a known category to its full
/// 3D shape in the canonical frame and the 6-DoF camera of every frame.
#[derive(Parser)]
#[command(version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Solve(Box<solve::Args>),
    #[cfg(feature = "vision")]
    Prepare(prepare::Args),
    Inspect(inspect::Args),
    Import(import::Args),
    Eval(eval::Args),
    Report(report::Args),
    Batch(batch::Args),
    Compare(compare::Args),
    Render(render::Args),
    Reproduce(reproduce::Args),
    Prior(prior::Args),
    Regressor(regressor::Args),
}

/// Runs the verb; an error is one line on standard error and exit status 1.
pub fn run() -> ExitCode {
    spba_ceres::quiet_guarded_panics();
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "warn".into()),
        )
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .init();
    let verb = Cli::parse().verb;
    spba_ceres::keep_freed_memory();
    let outcome = spba_ceres::route_ceres_logs()
        .map_err(anyhow::Error::from)
        .and_then(|()| run_verb(verb));
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run_verb(verb: Verb) -> anyhow::Result<()> {
    match verb {
        Verb::Solve(args) => solve::run(&args),
        #[cfg(feature = "vision")]
        Verb::Prepare(args) => prepare::run(&args),
        Verb::Inspect(args) => inspect::run(&args),
        Verb::Import(args) => import::run(&args),
        Verb::Eval(args) => eval::run(&args),
        Verb::Report(args) => report::run(&args),
        Verb::Batch(args) => batch::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::Render(args) => render::run(&args),
        Verb::Reproduce(args) => reproduce::run(&args),
        Verb::Prior(args) => prior::run(&args),
        Verb::Regressor(args) => regressor::run(&args),
    }
}
