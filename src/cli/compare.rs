//! `spba-ceres compare`: minimisers and strategies on one objective from the same starts.

use super::input::InputArgs;
use super::progress::StudyWatch;
use anyhow::Context;
use spba_ceres::prior;
use spba_ceres::study::{self, Comparison, Effort, Jobs, MinimiserSettings, Subject};
use std::path::{Path, PathBuf};

/// Compare minimisers on one sequence, with or without truth: the same objective, the same starts, the same rule for
/// visibility.
///
/// Without --minimisers: Levenberg-Marquardt and L-BFGS, each joint and alternating. Every state at the end of a solver call is
/// judged at full resolution with its own visibility; the best of all from the same start is what the others are measured
/// against. Seconds are processor seconds of the one thread that solves. An interrupted run goes on where it stopped.
#[derive(clap::Args)]
#[command(after_help = "MINIMISERS.toml (--print-config prints one to start from):

    schema = 1
    prior = \"car\"                             # for all minimisers; may be left out
    [perturbation]                            # for all; of the starts of seeds 1 and on
    rotation_deg = 5.0
    share_of_distance = 0.02
    [objective]                               # keys of solve --print-config; [init] likewise
    photometric_weight = 2e-4
    [solver]                                  # keys of solve --print-config
    max_steps = 10
    [[minimisers]]
    name = \"lbfgs-5\"                          # of letters, digits, `.`, `_` and `-`
    minimiser = { method = \"lbfgs\", rank = 5 } # or any other key of [solver]
    strategy = \"alternating\"

Files in OUT: compare.md (the table), compare.csv (a line per minimiser and seed), compare-calls.csv (a line per judged state), compare-iterations.csv (a line per iteration, as the minimiser saw it), compare.json (everything), compare-*.svg (charts of seed 0), compare.toml (the minimisers). All but processor seconds is the same in every run.")]
pub struct Args {
    #[command(flatten)]
    input: Option<InputArgs>,
    /// What to compare: TOML, see below [default: what --print-config prints]
    #[arg(long, value_name = "FILE")]
    minimisers: Option<PathBuf>,
    /// Print the minimisers that are compared by default, as a file for --minimisers, and end
    #[arg(long, exclusive = true)]
    print_config: bool,
    /// Starts: seed 0 is the best of the short solves, each further one is perturbed from it
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Folder for compare.md, .csv, .json and charts (SVG)
    #[arg(long, short, value_name = "DIR", default_value = "results")]
    out: PathBuf,
    /// Folder that keeps the records of solves
    #[arg(long, value_name = "DIR", default_value = "out/study")]
    cache: PathBuf,
    /// Solves side by side; 1 on an idle machine for processor seconds that can be relied on [default: one per core]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    threads: usize,
    /// A minute instead of many: shows that all works, the figures mean nothing
    #[arg(long)]
    quick: bool,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let settings = match &args.minimisers {
        Some(path) => MinimiserSettings::load(path)?,
        None => MinimiserSettings::shipped()?,
    };
    // Without --print-config clap demands an input.
    let (false, Some(input)) = (args.print_config, &args.input) else {
        print!("{}", settings.text);
        return Ok(());
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build_global()
        .context("threads")?;
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    // Before a folder is made and work is done.
    prior::find(&settings.prior)?;
    let subject = Subject::load(&name_of(&input.input), &input.input, input.options()?)?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let watch = StudyWatch::start()?;
    let jobs = Jobs::new(&args.cache.join("records"), &watch)?;
    let comparison = study::compare(&subject, &settings, args.seeds, &jobs, effort)?;
    watch.finish();
    write(&comparison, &settings, args)?;
    print!("{}\n{}", comparison.summary().text(), comparison.words());
    println!("written to {}/compare*", args.out.display());
    Ok(())
}

/// The folder's own name, also of `.`.
fn name_of(input: &Path) -> String {
    let absolute = || input.canonicalize().ok();
    let name = match input.file_name() {
        Some(name) => Some(name.to_owned()),
        None => absolute().and_then(|path| path.file_name().map(ToOwned::to_owned)),
    };
    name.unwrap_or_default().to_string_lossy().into_owned()
}

fn write(comparison: &Comparison, settings: &MinimiserSettings, args: &Args) -> anyhow::Result<()> {
    let record = serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "meaningful": !args.quick,
        "seeds": args.seeds,
        "comparison": comparison,
    });
    let table = format!("{}\n{}", comparison.summary().markdown(), comparison.words());
    let file = |ending: &str| args.out.join(format!("compare{ending}"));
    comparison.draw(&args.out)?;
    study::write_text(&file(".toml"), &settings.text)?;
    study::write_text(&file(".json"), &serde_json::to_string(&record)?)?;
    study::write_text(&file(".csv"), &comparison.results().csv())?;
    study::write_text(&file("-calls.csv"), &comparison.calls().csv())?;
    study::write_text(&file("-iterations.csv"), &comparison.iterations().csv())?;
    Ok(study::write_text(&file(".md"), &table)?)
}
