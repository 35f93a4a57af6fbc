//! `spba-ceres batch`.

mod list;
mod summary;

use super::progress::interruption;
use anyhow::{Context, ensure};
use list::{Job, List};
use rayon::prelude::*;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;
use summary::{Outcome, Row};

/// Solve a list of sequences, one process each, and say in a table what came out.
///
/// A second run goes on where the first ended: what has a result is not solved again, what failed or was interrupted is. What each solve
/// printed is in OUT/NAME.log, its result in OUT/NAME, the table in OUT/summary.csv.
/// Exit status 0 if every sequence has a usable result.
#[derive(clap::Args)]
#[command(after_help = "LIST.toml:

    schema = 1
    options = [\"--prior\", \"car\"]       # of solve, for every sequence; may be left out
    [[sequences]]
    input = \"sequences/first\"                  # as for solve; relative to the list's folder
    [[sequences]]
    input = \"videos/second.mp4\"
    name = \"second\"                            # of its result [default: the input's, without extension]
    options = [\"--frames\", \"0..16\"]            # of solve, after those for every sequence")]
pub struct Args {
    /// What to solve: TOML, see below
    list: PathBuf,
    /// Folder for the results; made if it is not there
    #[arg(long, short)]
    out: PathBuf,
    /// Solves at a time; each takes a thread per core, unless the options hold --threads
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    jobs: u16,
    /// Solve this one alone, counted from 0 in the list, and write no table: for jobs of a cluster
    #[arg(long, value_name = "N", conflicts_with = "jobs")]
    only: Option<usize>,
    /// Print the names of the sequences, one a line, and end
    #[arg(long, conflicts_with_all = ["only", "jobs", "summary"])]
    names: bool,
    /// Solve nothing; say what is there
    #[arg(long, conflicts_with_all = ["only", "jobs"])]
    summary: bool,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let list = List::load(&args.list)?;
    if args.names {
        list.jobs.iter().for_each(|job| println!("{}", job.name));
        return Ok(());
    }
    let jobs = match args.only {
        None => &list.jobs[..],
        Some(index) => {
            let last = list.jobs.len() - 1;
            let job = list.jobs.get(index..=index);
            job.with_context(|| format!("--only {index}: the list's last is {last}"))?
        }
    };
    for job in &list.jobs {
        job.check_record(&args.out)?;
    }
    if !args.summary {
        solve(args, jobs)?;
    }
    let rows: Vec<Row> = jobs.iter().map(|job| Row::read(job, &args.out)).collect();
    if args.only.is_none() {
        print!("{}", summary::table(&rows));
        summary::write_csv(&rows, &args.out.join("summary.csv"))?;
    }
    let without: Vec<&str> = rows
        .iter()
        .filter(|row| !row.is_usable())
        .map(|row| row.name.as_str())
        .collect();
    ensure!(
        without.is_empty(),
        "{} of {} without a usable result: {}; their .log files in {} say why",
        without.len(),
        rows.len(),
        without.join(", "),
        args.out.display()
    );
    Ok(())
}

/// Runs what has no result yet.
fn solve(args: &Args, jobs: &[Job]) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let open: Vec<&Job> = jobs
        .iter()
        .filter(|job| Row::read(job, &args.out).is_open())
        .collect();
    let interrupted = interruption()?;
    let done = AtomicUsize::new(jobs.len() - open.len());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(args.jobs))
        .build()
        .context("--jobs")?;
    pool.install(|| {
        // By one, so that an early long one does not hold back what a thread took with it.
        open.par_iter().with_max_len(1).try_for_each(|job| {
            if interrupted.load(Ordering::SeqCst) {
                return Ok(());
            }
            let began = Instant::now();
            run_one(job, args, &interrupted)?;
            let row = Row::read(job, &args.out);
            eprintln!(
                "{} of {}: {} {} ({:.0} s)",
                1 + done.fetch_add(1, Ordering::SeqCst),
                jobs.len(),
                row.name,
                row.outcome,
                began.elapsed().as_secs_f64()
            );
            Ok(())
        })
    })
}

/// One `solve` in a process of its own, which Ctrl-C reaches as it does this one.
fn run_one(job: &Job, args: &Args, interrupted: &AtomicBool) -> anyhow::Result<()> {
    job.write_record(&args.out)?;
    let result = job.result(&args.out);
    if Row::read(job, &args.out).outcome == Outcome::Interrupted {
        std::fs::remove_dir_all(&result).with_context(|| result.display().to_string())?;
    }
    let log = args.out.join(format!("{}.log", job.name));
    let file = std::fs::File::create(&log).with_context(|| log.display().to_string())?;
    let program = std::env::current_exe().context("this program's own path")?;
    let status = Command::new(&program)
        .arg("solve")
        .arg(&job.input)
        .arg("--out")
        .arg(&result)
        .args(&job.options)
        .stdin(Stdio::null())
        .stdout(file.try_clone().with_context(|| log.display().to_string())?)
        .stderr(file)
        .status()
        .with_context(|| program.display().to_string())?;
    // What a signal ended has no words of its own in the log.
    if status.code().is_none() && !interrupted.load(Ordering::SeqCst) {
        eprintln!("{}: ended by {status}", job.name);
    }
    Ok(())
}
