//! `spba-ceres prior`: learn, judge and show shape priors.

mod learning;
mod sources;
mod surface;

use super::progress::{self, interruption};
use anyhow::{Context, bail};
use learning::{Kind, Learning, Network};
pub use sources::load_models;
use sources::{licences, source_of};
use spba_ceres::cad::{NamedModel, OutsideSample};
use spba_ceres::prior::learn::{Correspondences, LearnOptions, Progress, SAMPLES, TrainingShape, correspond};
use spba_ceres::prior::{self, PriorInfo, ShapePrior};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Learn, show and judge shape priors.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    Learn(Learn),
    Eval(Eval),
    Show(Show),
}

/// Learn a prior from CAD models.
#[derive(clap::Args)]
struct Learn {
    #[command(flatten)]
    models: Models,
    #[arg(long, value_enum, default_value_t = Kind::Linear)]
    kind: Kind,
    #[command(flatten)]
    network: Network,
    /// Go on with the training that an earlier run of the same command left unfinished.
    #[arg(long)]
    resume: bool,
    /// The .safetensors file to write.
    #[arg(long)]
    out: PathBuf,
    /// Learn a prior of surfaces: an OBJ file with the half x >= 0 of a closed mesh to draw onto the models.
    #[arg(long)]
    template: Option<PathBuf>,
    /// Surfaces: also write the template drawn onto each model, an OBJ file each, to this folder.
    #[arg(long, requires = "template")]
    meshes: Option<PathBuf>,
    /// Surfaces: take the free form's amplitude and length from another prior of surfaces, where the models are too few to say
    #[arg(long, requires = "template", value_name = "PRIOR")]
    free_form_of: Option<String>,
    /// The number of style entries S
    #[arg(long, default_value_t = 16)]
    styles: usize,
    /// N, the number of points (even: mirrored pairs).
    #[arg(long, default_value_t = LearnOptions::default().points)]
    points: usize,
}

/// Leave-one-out Chamfer error: half of both mean nearest-neighbour distances, percent of the diagonal.
#[derive(clap::Args)]
struct Eval {
    #[command(flatten)]
    models: Models,
    #[arg(long, value_enum, value_delimiter = ',', default_value = "linear")]
    kinds: Vec<Kind>,
    #[command(flatten)]
    network: Network,
    /// Judge priors of surfaces, with and without free form: as for `learn`.
    #[arg(long, conflicts_with = "kinds")]
    template: Option<PathBuf>,
    /// Values of S to try; 0 is the mean shape.
    #[arg(long, value_delimiter = ',', default_value = "0,4,8,16,32")]
    styles: Vec<usize>,
    /// Points the reconstruction is compared at.
    #[arg(long, default_value_t = 2048)]
    points: usize,
    /// How far off a sample is taken to be when a shape is fitted, in diagonals: the more, the more the prior's likelihood counts.
    #[arg(long, value_delimiter = ',', default_values_t = [prior::DEFAULT_NOISE])]
    noise: Vec<f64>,
    /// Also print every held-out model's error with the most components.
    #[arg(long)]
    each: bool,
}

/// Draw the mean and each mode at −2σ and +2σ.
#[derive(clap::Args)]
struct Show {
    /// A bundled prior's name (car, chair-legs, chair-armchair, chair-foot, airplane) or a .safetensors file.
    prior: String,
    /// The PNG to write.
    #[arg(long)]
    out: PathBuf,
    /// Draw the first so many modes, 256 at most.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u16).range(0..=256))]
    modes: u16,
}

/// Which models to learn from, and how they are sampled and corresponded.
#[derive(clap::Args)]
struct Models {
    /// TOML list of sources (see data/priors/car.toml).
    #[arg(long)]
    sources: PathBuf,
    /// Surface samples drawn per model.
    #[arg(long, default_value_t = SAMPLES)]
    samples: usize,
    /// Points of the coarse correspondences.
    #[arg(long, default_value_t = LearnOptions::default().coarse_points)]
    coarse_points: usize,
    /// Rounds of assigning to the template and averaging.
    #[arg(long, default_value_t = LearnOptions::default().passes)]
    passes: usize,
    /// Learn from so many more shapes, mixed, stretched and bent out of the models.
    #[arg(long, default_value_t = 0)]
    augment: usize,
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Learn(args) => learn(args),
        Verb::Eval(args) => eval(args),
        Verb::Show(args) => show(args),
    }
}

fn learn(args: &Learn) -> anyhow::Result<()> {
    let options = args.models.options(args.points);
    options.check()?;
    check_folder(&args.out)?;
    args.kind.check()?;
    let checkpoint = args.out.with_extension("checkpoint");
    if checkpoint.exists() && !args.resume {
        bail!(
            "{}: an unfinished training's state is there: go on with --resume, or delete it",
            checkpoint.display()
        );
    }
    if let Some(template) = &args.template {
        return surface::learn(args, template);
    }
    let (list, models) = load_models(&args.models.sources)?;
    let refuse_styles = |possible: usize| {
        anyhow::ensure!(
            args.styles <= possible,
            "--styles {}: {} models and {} made of them give at most {possible}",
            args.styles,
            models.len(),
            args.models.augment
        );
        Ok(())
    };
    // Before the minutes that correspondences take; like models give fewer still.
    refuse_styles((models.len() + args.models.augment).saturating_sub(1))?;
    let shapes = args.models.sample(&models, 1, 0);
    let bar = Bar::new();
    let found = correspond(&shapes, &options, &mut |p| bar.show(&p))?;
    let learning = Learning {
        models: &args.models,
        network: &args.network,
        shapes: &found.shapes,
        weights: &models.iter().map(|model| model.weight).collect::<Vec<_>>(),
        normals: &found.normals,
    };
    // Principal components have no state to keep: Ctrl-C ends them at once.
    let interrupted = match args.kind {
        Kind::Decoder => interruption()?,
        Kind::Linear => Arc::default(),
    };
    let (prior, explained) =
        learning.learn(args.kind, args.styles, Some(&checkpoint), &mut |step, loss| {
            bar.training(step, args.network.steps, loss);
            !interrupted.load(Ordering::SeqCst)
        })?;
    refuse_styles(prior.style_len())?;
    let info = PriorInfo {
        command: args.command(),
        seed: args.models.seed,
        explained_variance: explained,
        licences: licences(&models),
        sources: models.iter().map(source_of).collect(),
        ..PriorInfo::mirrored(&list.category, &prior)
    };
    prior::save(&args.out, &prior, &info)?;
    bar.finish();
    println!(
        "{}: {} {}, {} models, {} points, {} styles{}",
        args.out.display(),
        info.category,
        info.kind,
        models.len(),
        args.points,
        args.styles,
        info.explained_variance
            .last()
            .map_or_else(String::new, |share| format!(
                ", {:.1} % of the variance",
                100.0 * share
            ))
    );
    Ok(())
}

/// A file can be written there.
fn check_folder(out: &Path) -> anyhow::Result<()> {
    if let Some(folder) = out.parent().filter(|f| !f.as_os_str().is_empty() && !f.is_dir()) {
        bail!(
            "--out {}: no folder {}: make it first",
            out.display(),
            folder.display()
        );
    }
    Ok(())
}

impl Learn {
    /// The command that repeats this, every option spelled out.
    fn command(&self) -> String {
        let mut command = format!(
            "spba-ceres prior learn --kind {} --out {} --styles {} --points {} {}",
            self.kind.name(),
            portable(&self.out),
            self.styles,
            self.points,
            self.models.words()
        );
        if let Some(template) = &self.template {
            command += &format!(" --template {}", portable(template));
        }
        if let Some(other) = &self.free_form_of {
            command += &format!(" --free-form-of {}", portable(Path::new(other)));
        }
        if self.kind == Kind::Decoder {
            command += &format!(" --width {} --steps {}", self.network.width, self.network.steps);
        }
        command
    }
}

/// A relative path as it is, of an absolute one its last component: the file is for other machines too.
pub fn portable(path: &Path) -> String {
    let name = if path.is_relative() {
        Some(path.as_os_str())
    } else {
        path.file_name()
    };
    name.unwrap_or_default().to_string_lossy().into_owned()
}

fn eval(args: &Eval) -> anyhow::Result<()> {
    if let Some(noise) = args
        .noise
        .iter()
        .find(|&&noise| !(noise > 0.0 && noise.is_finite()))
    {
        bail!("--noise {noise}: must be a length above 0, in diagonals");
    }
    if let Some(template) = &args.template {
        return surface::eval(args, template);
    }
    args.kinds.iter().try_for_each(|kind| kind.check())?;
    let options = args.models.options(args.points.max(8192));
    options.check()?;
    let (list, models) = load_models(&args.models.sources)?;
    let shapes = args.models.sample(&models, 1, 0);
    // Another seed, since errors are measured on samples that were not learned from; and more of them, since the gaps
    // between them add to the error.
    let truth = args.models.sample(&models, 2, 1 << 32);
    let truth: Vec<_> = truth.into_iter().map(|shape| shape.outside).collect();
    let bar = Bar::new();
    // More points are corresponded better; the first of them are an even sample.
    let found = correspond(&shapes, &options, &mut |p| bar.show(&p))?.first(args.points);
    let groups = list.groups(&models)?;
    let weights: Vec<f64> = models.iter().map(|model| model.weight).collect();
    let learner = |(kind, styles): (Kind, usize)| -> Box<prior::Learner> {
        let (args, found, weights) = (&args, &found, &weights);
        Box::new(move |of| {
            let shapes: Vec<_> = of.iter().map(|&m| found.shapes[m].clone()).collect();
            let weights: Vec<f64> = of.iter().map(|&m| weights[m]).collect();
            let learning = Learning {
                models: &args.models,
                network: &args.network,
                shapes: &shapes,
                weights: &weights,
                normals: &found.normals,
            };
            Ok(learning.learn(kind, styles, None, &mut |_, _| true)?.0)
        })
    };
    let ways: Vec<(Kind, usize)> = args
        .kinds
        .iter()
        .flat_map(|&kind| args.styles.iter().map(move |&styles| (kind, styles)))
        .filter(|&(kind, styles)| kind == Kind::Linear || styles > 0)
        .collect();
    let learners: Vec<_> = ways.iter().map(|&way| learner(way)).collect();
    let errors = prior::leave_one_out(&found, &truth, &groups, &learners, args.points, &args.noise)?;
    bar.finish();
    println!(
        "leave-one-out over {} models, {} points, % of the diagonal",
        models.len(),
        args.points
    );
    print_errors(&ways, &args.noise, &errors);
    let own = own_errors(&found, &truth, args.points);
    println!(
        "{:7} {:>6}  {:>17.3}  (the model's own corresponded points: the floor)",
        "-",
        "-",
        100.0 * own.iter().sum::<f64>() / own.len() as f64
    );
    let Some(&last) = ways.last() else {
        bail!("--styles: a decoder needs 1 or more");
    };
    println!(
        "\nthe canonical frame of a model left out, {} of {} styles",
        last.0.name(),
        last.1
    );
    for (known, words) in [
        (prior::Known::All, "all its points known"),
        (prior::Known::FromFrontRight, "those seen from its front right"),
    ] {
        let errors = prior::frame_errors(&found, &groups, &learner(last), args.points, known)?;
        print_frame_errors(&errors, words);
    }
    if args.each
        && let Some(last) = errors.last()
    {
        print_each(&models, last, &own);
    }
    Ok(())
}

/// The errors of a model left out, by kind and number of styles.
fn print_errors(ways: &[(Kind, usize)], noises: &[f64], errors: &[prior::FitError]) {
    println!(
        "{:7} {:>6}  {:>17}  {:>6}  {:>10}",
        "kind", "styles", "by correspondence", "noise", "by Chamfer"
    );
    for ((kind, styles), rows) in ways.iter().zip(errors.chunks(noises.len())) {
        for (noise, row) in noises.iter().zip(rows) {
            println!(
                "{:7} {styles:>6}  {:>17.3}  {noise:>6.3}  {:>10.3}",
                kind.name(),
                100.0 * row.by_correspondence,
                100.0 * row.by_chamfer
            );
        }
    }
}

/// The Chamfer distances of the models' own corresponded points, diagonals: the floor of what a prior can reach.
fn own_errors(found: &Correspondences, truth: &[OutsideSample], points: usize) -> Vec<f64> {
    let shapes = found.shapes.iter().zip(truth);
    shapes
        .map(|(shape, truth)| prior::chamfer(&prior::points_of(shape, points), &truth.points))
        .collect()
}

/// Model by model.
fn print_each(models: &[NamedModel], error: &prior::FitError, own: &[f64]) {
    println!("\n{:<32} {:>10} {:>10}", "model", "by Chamfer", "floor");
    for ((model, fit), own) in models.iter().zip(&error.each).zip(own) {
        println!(
            "{:<32} {:>10.3} {:>10.3}",
            model.name,
            100.0 * fit.chamfer,
            100.0 * own
        );
    }
}

/// What the pictures cannot tell: how far off the canonical frame of a model left out is.
fn print_frame_errors(errors: &[prior::FrameError], known: &str) {
    let n = errors.len() as f64;
    let scale: Vec<f64> = errors.iter().map(|e| 100.0 * (e.scale - 1.0)).collect();
    let mean = scale.iter().sum::<f64>() / n;
    let spread = (scale.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n).sqrt();
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let turn = median(errors.iter().map(|e| e.rotation.angle().to_degrees()).collect());
    let location: Vec<f64> = errors.iter().map(|e| 100.0 * e.camera_location()).collect();
    let within = location.iter().filter(|&&l| l < 2.0).count();
    println!(
        "  {known:<32} scale {mean:+.2} ± {spread:.2} %, rotation {turn:.2}° (median); a camera 1.7 diagonals away is off by \
         {:.2} % of the diagonal (median), in {within} of {n} by less than 2 %",
        median(location)
    );
}

fn show(args: &Show) -> anyhow::Result<()> {
    let (prior, info) = prior::open(&args.prior)?;
    let sheet = prior::contact_sheet(&prior, args.modes.into());
    let bytes: Vec<u8> = sheet.data().iter().flatten().map(|&x| x as u8).collect();
    let (width, height) = sheet.size();
    image::save_buffer(
        &args.out,
        &bytes,
        width as u32,
        height as u32,
        image::ColorType::Rgb8,
    )
    .with_context(|| format!("{}: cannot write the sheet", args.out.display()))?;
    println!(
        "{}: {}, {} points, {} styles",
        info.category, info.frame, info.points, info.styles
    );
    println!(
        "learned from {} models ({})",
        info.sources.len(),
        info.licences.join("; ")
    );
    println!("{}", info.command);
    for (k, share) in info.explained_variance.iter().enumerate() {
        print!(
            "{}{}: {:.1} %",
            if k == 0 { "variance explained by " } else { ", " },
            k + 1,
            100.0 * share
        );
    }
    println!("\nwrote {}", args.out.display());
    Ok(())
}

impl Models {
    /// Draws `times` the usual number of samples.
    fn sample(&self, models: &[NamedModel], times: usize, seed_offset: u64) -> Vec<TrainingShape> {
        let bar = Bar::new();
        let shape = |(index, model): (usize, &NamedModel)| {
            bar.show(&Progress {
                stage: "sampling",
                done: index,
                total: models.len(),
            });
            let seed = self.seed.wrapping_add(seed_offset).wrapping_add(index as u64);
            TrainingShape::new(&model.name, &model.mesh, times * self.samples, seed)
        };
        let shapes = models.iter().enumerate().map(shape).collect();
        bar.finish();
        shapes
    }

    /// As on a command line, every option spelled out.
    fn words(&self) -> String {
        format!(
            "--sources {} --samples {} --coarse-points {} --passes {} --augment {} --seed {}",
            portable(&self.sources),
            self.samples,
            self.coarse_points,
            self.passes,
            self.augment,
            self.seed
        )
    }

    fn options(&self, points: usize) -> LearnOptions {
        LearnOptions {
            points,
            coarse_points: self.coarse_points,
            passes: self.passes,
        }
    }
}

/// How far learning is.
pub struct Bar(progress::Progress);

impl Bar {
    pub fn new() -> Self {
        Self(progress::Progress::new())
    }

    pub fn training(&self, step: usize, steps: usize, loss: f64) {
        self.0
            .step_saying("training", &format!(", loss {loss:.5}"), step, steps);
    }

    pub fn show(&self, progress: &Progress) {
        self.0.step(progress.stage, progress.done, progress.total);
    }

    pub fn finish(&self) {
        self.0.finish();
    }
}
