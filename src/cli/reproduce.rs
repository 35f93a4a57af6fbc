//! `spba-ceres reproduce`: the paper's tables and figures on our benchmark.

use super::progress::StudyWatch;
use anyhow::Context;
use clap::ValueEnum;
use serde::Serialize;
use spba_ceres::cad::scene::{self, Benchmark, Scene};
use spba_ceres::sequence::{self, FrameWindow, LoadOptions};
use spba_ceres::study::{self, Effort, Jobs, SequenceKind, StudyError, Subject, Table};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;

/// Make a table or a figure of the paper: data (CSV, JSON) and charts (SVG).
///
/// Sequences are rendered and solves done only where their records are missing, so that an interrupted run goes on
/// where it stopped, and what two figures share is done once.
#[derive(clap::Args)]
pub struct Args {
    what: What,
    /// Folder for data and charts
    #[arg(long, default_value = "results")]
    out: PathBuf,
    /// Folder that keeps rendered sequences and the records of solves
    #[arg(long, default_value = "out/study")]
    cache: PathBuf,
    /// The list of rendered sequences
    #[arg(long, default_value = "data/benchmarks/rendered.toml")]
    benchmark: PathBuf,
    /// A natural sequence on a turning platform (turn.txt, times.txt, perhaps openmvs/) for table1; may be repeated
    #[arg(long, value_name = "FOLDER")]
    natural: Vec<PathBuf>,
    /// A rendered sequence whose poses and sparse points are COLMAP's, as scripts/off_the_shelf and import --truth make, for
    /// table1; may be repeated
    #[arg(long, value_name = "FOLDER")]
    real_input: Vec<PathBuf>,
    /// The same with openMVS's depth, as import --depth --truth makes, in a block of its own; may be repeated
    #[arg(long, value_name = "FOLDER")]
    openmvs_input: Vec<PathBuf>,
    /// Frames per rendered sequence; fig7 goes through those of the list up to this many
    #[arg(long, value_name = "L", default_value_t = 11)]
    frames: usize,
    /// Minutes instead of hours, on a few small frames of the bundled sequence: shows that all works, the figures mean
    /// nothing
    #[arg(long)]
    quick: bool,
    /// Solves side by side [default: one per core]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    threads: usize,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum What {
    /// Methods against truth, and on natural sequences
    Table1,
    /// The cost over p0 and the motion around the optimum
    Fig3,
    /// The distribution of the depth error
    Fig6,
    /// Depth error against the number of frames
    Fig7,
    /// p0 at convergence against p0 at the start
    Fig8,
    /// Weights, Huber widths and terms changed one at a time
    Ablation,
}

/// What goes into the JSON beside the data.
#[derive(Serialize)]
struct Record<'a, T: Serialize> {
    what: What,
    version: &'a str,
    /// False for `--quick`, whose figures mean nothing.
    meaningful: bool,
    sequences: Vec<SourceRecord<'a>>,
    data: T,
}

/// What `--quick` solves.
const BUNDLED: &str = "data/sequences/car";

/// A sequence of the record, and the scene that it was rendered from, seed included.
#[derive(Serialize)]
struct SourceRecord<'a> {
    name: &'a str,
    scene: Option<&'a Scene>,
}

/// A sequence that is to be solved.
#[derive(Clone)]
struct Source {
    name: String,
    folder: PathBuf,
    kind: SequenceKind,
    scene: Option<Scene>,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build_global()
        .context("threads")?;
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let rendered = rendered(args)?;
    let further = further(args, effort)?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let watch = StudyWatch::start()?;
    let jobs = Jobs::new(&args.cache.join("records"), &watch)?;
    match args.what {
        What::Table1 => {
            let all = [rendered, further].concat();
            let table = study::table1(with_kind(&all, effort), &jobs, effort)?;
            watch.finish();
            let summary = table.summary();
            write(args, "table1", &all, &table, &table.details(), Some(&summary))
        }
        What::Fig6 => {
            let table = study::table1(with_kind(&rendered, effort), &jobs, effort)?;
            watch.finish();
            let figure = study::fig6(&table);
            figure.draw(&args.out)?;
            write(args, "fig6", &rendered, &figure.rows, &figure.table(), None)
        }
        What::Fig7 => {
            let figure = study::fig7(lazily(&rendered, effort), &jobs, effort)?;
            watch.finish();
            figure.draw(&args.out)?;
            let table = figure.table();
            write(args, "fig7", &rendered, &figure, &table, Some(&table))
        }
        What::Fig8 => {
            let figure = study::fig8(lazily(&rendered, effort), &jobs, effort)?;
            watch.finish();
            figure.draw(&args.out)?;
            let summary = figure.summary();
            write(args, "fig8", &rendered, &figure, &figure.table(), Some(&summary))
        }
        What::Ablation => {
            let table = study::ablation(lazily(&rendered, effort), &jobs, effort)?;
            watch.finish();
            let summary = table.summary();
            write(
                args,
                "ablation",
                &rendered,
                &table,
                &table.details(),
                Some(&summary),
            )
        }
        What::Fig3 => {
            let first = &rendered[..1];
            let subject = lazily(first, effort).next().context("no sequence")??;
            let figure = study::fig3(&subject, &jobs, effort)?;
            watch.finish();
            figure.draw(&args.out)?;
            write(args, "fig3", first, &figure, &figure.table(), None)
        }
    }
}

/// The benchmark's sequences, rendered where they are not yet; the bundled one with `--quick`. At least one.
fn rendered(args: &Args) -> anyhow::Result<Vec<Source>> {
    let rendered = match args.quick {
        false => render(args, &Benchmark::load(&args.benchmark)?)?,
        true => vec![Source {
            name: "car".to_owned(),
            folder: PathBuf::from(BUNDLED),
            kind: SequenceKind::Rendered,
            scene: None,
        }],
    };
    anyhow::ensure!(
        !rendered.is_empty(),
        "{}, --frames {}: no sequence; name one and give at least its least number of frames",
        args.benchmark.display(),
        args.frames
    );
    Ok(rendered)
}

/// Sequences beside the benchmark's, each read once: what cannot be used is told now, not after the hours that those before them take.
fn further(args: &Args, effort: Effort) -> anyhow::Result<Vec<Source>> {
    let groups = [
        (&args.real_input, SequenceKind::RenderedRealInput, "-real-input"),
        (
            &args.openmvs_input,
            SequenceKind::RenderedOpenMvsInput,
            "-openmvs-input",
        ),
        (&args.natural, SequenceKind::Natural, ""),
    ];
    anyhow::ensure!(
        args.what == What::Table1 || groups.iter().all(|(folders, ..)| folders.is_empty()),
        "--natural, --real-input, --openmvs-input: only table1 takes further sequences; leave them out"
    );
    let mut sources = Vec::new();
    for (folders, kind, suffix) in groups {
        for folder in folders {
            let name = folder
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
                + suffix;
            let subject = Subject::load(&name, folder, load_options(effort))?;
            anyhow::ensure!(
                kind == SequenceKind::Natural || subject.sequence.truth.is_some(),
                "{}: no [truth]; make it with spba-ceres import --truth",
                folder.display()
            );
            sources.push(Source {
                name,
                folder: folder.clone(),
                kind,
                scene: None,
            });
        }
    }
    Ok(sources)
}

/// The benchmark's sequences of as many frames as asked for; those that are missing are rendered.
fn render(args: &Args, benchmark: &Benchmark) -> anyhow::Result<Vec<Source>> {
    let counts: Vec<usize> = match args.what {
        What::Fig7 => benchmark
            .frames
            .iter()
            .copied()
            .filter(|&count| count <= args.frames)
            .collect(),
        _ => vec![args.frames],
    };
    let mut sources = Vec::new();
    for count in counts {
        for name in benchmark.names() {
            let full_name = format!("{name}-{count}");
            let scene = benchmark.scene(name, count)?;
            // A changed list, or renderer, must not find what an earlier one had rendered.
            let mut hasher = DefaultHasher::new();
            (serde_json::to_string(&scene)?, scene::renderer_digest()).hash(&mut hasher);
            let folder = args
                .cache
                .join("rendered")
                .join(format!("{full_name}-{:016x}", hasher.finish()));
            if !folder.exists() {
                sequence::write(&scene::synthesise(&scene, &full_name)?, &folder)?;
            }
            sources.push(Source {
                name: full_name,
                folder,
                kind: SequenceKind::Rendered,
                scene: Some(scene),
            });
        }
    }
    Ok(sources)
}

/// Loads one sequence after the other: long ones would not fit side by side.
fn lazily(sources: &[Source], effort: Effort) -> impl Iterator<Item = Result<Subject, StudyError>> {
    sources
        .iter()
        .map(move |source| Subject::load(&source.name, &source.folder, load_options(effort)))
}

/// The same for Table 1.
fn with_kind(
    sources: &[Source],
    effort: Effort,
) -> impl Iterator<Item = (SequenceKind, Result<Subject, StudyError>)> {
    let kinds = sources.iter().map(|source| source.kind);
    kinds.zip(lazily(sources, effort))
}

fn load_options(effort: Effort) -> LoadOptions {
    LoadOptions {
        window: match effort {
            Effort::Full => FrameWindow::default(),
            Effort::Quick => FrameWindow {
                end: Some(4),
                ..FrameWindow::default()
            },
        },
        ..LoadOptions::default()
    }
}

/// Writes a study's data beside its charts and prints its table.
fn write<T: Serialize>(
    args: &Args,
    name: &str,
    sources: &[Source],
    data: &T,
    details: &Table,
    summary: Option<&Table>,
) -> anyhow::Result<()> {
    let record = Record {
        what: args.what,
        version: env!("CARGO_PKG_VERSION"),
        meaningful: !args.quick,
        sequences: sources
            .iter()
            .map(|source| SourceRecord {
                name: &source.name,
                scene: source.scene.as_ref(),
            })
            .collect(),
        data,
    };
    let out = &args.out;
    study::write_text(
        &out.join(format!("{name}.json")),
        &serde_json::to_string(&record)?,
    )?;
    study::write_text(&out.join(format!("{name}.csv")), &details.csv())?;
    if let Some(summary) = summary {
        study::write_text(&out.join(format!("{name}.md")), &summary.markdown())?;
        print!("{}", summary.text());
    }
    println!("written to {}/{name}*", out.display());
    Ok(())
}
