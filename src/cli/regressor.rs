//! `spba-ceres regressor`: train and judge the network that guesses a first style.

use super::prior::{Bar, load_models};
use spba_ceres::cad::scene::{Benchmark, synthesise};
use spba_ceres::cad::{NamedModel, sample_outside};
use spba_ceres::prior::learn::Progress;
use spba_ceres::prior::{self, LearnedPrior};
use spba_ceres::regressor::{self, Guesses, POINTS, judge};
use spba_ceres::sequence::{Sequence, SequenceError};
use std::path::PathBuf;

/// Train and judge the network that guesses a first style from the frames.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    Train(Train),
    Eval(Eval),
}

/// Train a regressor on rendered sequences of CAD models and of random styles; needs a build with the feature `training`.
#[derive(clap::Args)]
struct Train {
    /// The prior whose styles it is to guess: a bundled name or a .safetensors file.
    #[arg(long)]
    prior: String,
    /// TOML list of the CAD models to show, those that the prior was learned from.
    #[arg(long)]
    sources: PathBuf,
    /// The .safetensors file to write.
    #[arg(long)]
    out: PathBuf,
    /// Rendered sequences of CAD models, and as many of random styles.
    #[arg(long, default_value_t = 1500)]
    sequences: usize,
    /// Frames of each.
    #[arg(long, default_value_t = 5)]
    frames: usize,
    #[arg(long, default_value_t = 4000)]
    steps: usize,
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Go on with the training that an earlier run of the same command left unfinished.
    #[arg(long)]
    resume: bool,
}

/// Chamfer errors of first guesses on a benchmark's objects: the regressor's, the mean shape's, and those of the training model
/// whose silhouettes fit best under the true cameras.
#[derive(clap::Args)]
struct Eval {
    /// A regressor file.
    regressor: PathBuf,
    /// Its prior.
    #[arg(long)]
    prior: String,
    /// List of rendered sequences whose objects neither has seen.
    #[arg(long, default_value = "data/benchmarks/rendered.toml")]
    benchmark: PathBuf,
    /// TOML list of the models to retrieve from; none without.
    #[arg(long)]
    sources: Option<PathBuf>,
    /// Frames to guess from, spread over each sequence.
    #[arg(long, value_delimiter = ',', default_value = "1,2,5,11")]
    frames: Vec<usize>,
    /// Each sequence from so many sides, evenly around the object.
    #[arg(long, default_value_t = 6)]
    sides: usize,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Train(args) => train(args),
        Verb::Eval(args) => eval(args),
    }
}

#[cfg(not(feature = "training"))]
fn train(_: &Train) -> anyhow::Result<()> {
    Err(prior::learn::LearnError::NoTraining.into())
}

#[cfg(feature = "training")]
fn train(args: &Train) -> anyhow::Result<()> {
    use super::prior::portable;
    use super::progress::interruption;
    use regressor::{ExampleOptions, Examples, Model, REGRESSOR_RATE, Regressor, RegressorInfo};
    use std::sync::atomic::{AtomicUsize, Ordering};

    let checkpoint = args.out.with_extension("checkpoint");
    anyhow::ensure!(
        args.resume || !checkpoint.exists(),
        "{}: an unfinished training's state is there: go on with --resume, or delete it",
        checkpoint.display()
    );
    anyhow::ensure!(
        args.frames > 0 && args.sequences > 0,
        "--frames, --sequences: give at least 1"
    );
    let (learned, info) = prior::open(&args.prior)?;
    let (_, models) = load_models(&args.sources)?;
    let styles = styles(&learned, &models);
    let shown: Vec<Model> = models
        .iter()
        .zip(styles)
        .map(|(model, style)| Model {
            mesh: &model.mesh,
            style,
        })
        .collect();
    let bar = Bar::new();
    let (done, total) = (AtomicUsize::new(0), 2 * args.sequences);
    let options = ExampleOptions {
        sequences: args.sequences,
        frames: args.frames,
        seed: args.seed,
    };
    let examples = Examples::render(&learned, &shown, &options, &|| {
        bar.show(&Progress {
            stage: "rendering",
            done: done.fetch_add(1, Ordering::Relaxed) + 1,
            total,
        });
    });
    let command = format!(
        "spba-ceres regressor train --prior {} --sources {} --out {} --sequences {} --frames {} --steps {} --seed {}",
        args.prior,
        portable(&args.sources),
        portable(&args.out),
        args.sequences,
        args.frames,
        args.steps,
        args.seed
    );
    let plan = spba_ceres::training::Plan {
        steps: args.steps,
        learning_rate: REGRESSOR_RATE,
        checkpoint: Some(checkpoint),
        of: command.clone(),
    };
    let interrupted = interruption()?;
    let mut recent = 1.0;
    let mirrored = info.symmetry == prior::Symmetry::MirrorX;
    let mut see = |step, loss: f64| {
        recent += 0.05 * (loss - recent);
        bar.training(step, args.steps, recent);
        !interrupted.load(Ordering::SeqCst)
    };
    let network = regressor::train(&learned, mirrored, &examples, args.seed, &plan, &mut see)?;
    bar.finish();
    let info = RegressorInfo::new(&info, network.convolutions.len(), command, args.seed);
    regressor::save(&args.out, &Regressor { info, network })?;
    println!(
        "{}: {} models, {} sequences, loss {recent:.3} of the mean shape's",
        args.out.display(),
        models.len(),
        examples.len()
    );
    Ok(())
}

/// The styles that come nearest to models.
fn styles(prior: &LearnedPrior, models: &[NamedModel]) -> Vec<Vec<f64>> {
    let bar = Bar::new();
    let style = |(done, model): (usize, &NamedModel)| {
        bar.show(&Progress {
            stage: "fitting",
            done,
            total: models.len(),
        });
        let outside = sample_outside(&model.mesh, prior::learn::SAMPLES / 4, 0);
        prior::style_of(prior, &outside.points, POINTS)
    };
    let styles = models.iter().enumerate().map(style).collect();
    bar.finish();
    styles
}

fn eval(args: &Eval) -> anyhow::Result<()> {
    let regressor = regressor::load(&args.regressor)?;
    let (learned, info) = prior::open(&args.prior)?;
    let benchmark = Benchmark::load(&args.benchmark)?;
    let most = args.frames.iter().copied().max().unwrap_or(0);
    anyhow::ensure!(
        args.sides > 0 && args.frames.iter().all(|&frames| frames > 0) && most > 0,
        "--frames, --sides: give at least 1"
    );
    let known = match &args.sources {
        Some(sources) => styles(&learned, &load_models(sources)?.1),
        None => Vec::new(),
    };
    let bar = Bar::new();
    let (names, mut done) = (benchmark.names(), 0);
    let mut guesses: Vec<Vec<Guesses>> = vec![Vec::new(); args.frames.len()];
    for name in &names {
        for side in 0..args.sides {
            bar.show(&Progress {
                stage: "guessing",
                done,
                total: names.len() * args.sides,
            });
            done += 1;
            let mut scene = benchmark.scene(name, most)?;
            let turn = 360.0 * side as f64 / args.sides as f64;
            scene.arc.azimuth_deg = scene.arc.azimuth_deg.map(|azimuth| azimuth + turn);
            let whole = synthesise(&scene, name)?;
            for (&frames, guesses) in args.frames.iter().zip(&mut guesses) {
                let part = spread(&whole, frames)?;
                if let Some(truth) = &part.truth {
                    guesses.push(judge(&regressor, (&learned, &info), &known, &part, truth)?);
                }
            }
        }
    }
    bar.finish();
    println!(
        "first guesses at {} sequences from {} sides each, mean Chamfer error, % of the diagonal at {POINTS} points",
        names.len(),
        args.sides
    );
    println!(
        "{:>6}  {:>9}  {:>9}  {:>9}  {:>9}",
        "frames", "regressor", "mean", "retrieved", "best"
    );
    for (frames, guesses) in args.frames.iter().zip(&guesses) {
        let mean = |value: &dyn Fn(&Guesses) -> Option<f64>| -> Option<f64> {
            let values: Option<Vec<f64>> = guesses.iter().map(value).collect();
            values.map(|values| 100.0 * values.iter().sum::<f64>() / values.len() as f64)
        };
        let cell = |mean: Option<f64>| mean.map_or_else(|| "-".to_owned(), |mean| format!("{mean:.3}"));
        println!(
            "{frames:>6}  {:>9}  {:>9}  {:>9}  {:>9}",
            cell(mean(&|g| Some(g.regressor))),
            cell(mean(&|g| Some(g.mean))),
            cell(mean(&|g| g.retrieved)),
            cell(mean(&|g| Some(g.best)))
        );
    }
    Ok(())
}

/// So many of the frames, evenly over the sequence, with their truth.
fn spread(whole: &Sequence, frames: usize) -> Result<Sequence, SequenceError> {
    let last = whole.frames.len() - 1;
    let chosen: Vec<usize> = (0..frames)
        .map(|k| {
            if frames == 1 {
                last / 2
            } else {
                k * last / (frames - 1)
            }
        })
        .collect();
    let mut part = whole.clone().into_content();
    part.frames = chosen.iter().map(|&k| whole.frames[k].clone()).collect();
    if let (Some(truth), Some(all)) = (&mut part.truth, &whole.truth) {
        truth.camera_from_object = chosen.iter().map(|&k| all.camera_from_object[k]).collect();
        truth.depth = chosen.iter().map(|&k| all.depth[k].clone()).collect();
    }
    Sequence::new(part)
}
