//! `spba-ceres solve`.

#[cfg(feature = "vision")]
use super::input::made_beside;
use super::input::read;
use super::progress;
use anyhow::Context;
use clap::ValueEnum;
use spba_ceres::config::Config;
use spba_ceres::init::{self, Initialisation};
use spba_ceres::objective::Footage;
#[cfg(feature = "vision")]
use spba_ceres::prepare::Input;
use spba_ceres::prior::{self, LearnedPrior, PriorInfo, ShapePrior};
use spba_ceres::report::{self, FrameResult, ReportInput, RunResult, Surface};
use spba_ceres::sequence::{Frame, Sequence};
use spba_ceres::solver::{
    LinearSolver, Minimiser, ScaleUpdate, Solution, Strategy, Termination, default_lbfgs_rank,
};
use spba_ceres::{regressor, solver};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Recover an object's full shape and every camera from a sequence.
///
/// INPUT is a sequence folder (`sequence.toml`), a COLMAP workspace (`images/`, `sparse/`, `masks/`, perhaps
/// `stereo/depth_maps/`), or a video or folder of pictures, of which a sequence folder is made first, beside the result; it stays for
/// the next run. Flags override the configuration file, which overrides the defaults.
#[derive(clap::Args)]
pub struct Args {
    /// Sequence folder, COLMAP workspace, video or folder of pictures
    input: PathBuf,
    /// Folder for the result; must not exist
    #[arg(long, short)]
    out: PathBuf,
    /// Shape prior: the name of a bundled one, or a file [default: car]
    #[arg(long)]
    prior: Option<String>,
    /// TOML file with any of the keys of a result's config.toml
    #[arg(long)]
    config: Option<PathBuf>,
    /// openMVS folder (scene.mvs, depth*.dmap) that goes with a COLMAP workspace
    #[arg(long)]
    depth: Option<PathBuf>,
    /// Frames to use, such as 0..16 [default: all]
    #[arg(long, value_name = "START..END")]
    frames: Option<String>,
    /// Use every n-th of these frames [default: 1]
    #[arg(long, value_name = "N")]
    every: Option<usize>,
    /// The frame that all others are compared with, counted from 0 among the frames in use [default: the middle
    /// one; the paper takes the first]
    #[arg(long, value_name = "N")]
    target: Option<usize>,
    /// Ceres minimiser [default: lm; the paper uses lbfgs]
    #[arg(long)]
    solver: Option<Method>,
    /// Which variables move together: all (joint), or p0, motion and style in turn as in Algorithm 1
    /// (alternating) [default: joint; the paper alternates]
    #[arg(long)]
    strategy: Option<StrategyArg>,
    /// How the scale α is found: in every solver call, or between them by Eq. 8 [default: variable; the paper's is
    /// regression]
    #[arg(long)]
    scale_update: Option<ScaleUpdateArg>,
    #[cfg(feature = "vision")]
    #[command(flatten)]
    raw: super::prepare::RawArgs,
    #[command(flatten)]
    objective: ObjectiveArgs,
    /// Pyramid levels [default: 3; the paper mentions none]
    #[arg(long, value_name = "N")]
    levels: Option<usize>,
    /// Steps of Algorithm 1 per pyramid level [default: 20]
    #[arg(long, value_name = "N")]
    max_steps: Option<usize>,
    /// Ceres iterations per call [default: 20]
    #[arg(long, value_name = "N")]
    iterations: Option<u32>,
    /// Stop once the objective is below (δ_L) [default: 0]
    #[arg(long, value_name = "VALUE")]
    threshold: Option<f64>,
    /// Stop when a step lowers the objective by a smaller share [default: 0.0003]
    #[arg(long, value_name = "SHARE")]
    tolerance: Option<f64>,
    /// First trust-region radius (lm only) [default: 1e4]
    #[arg(long, value_name = "RADIUS")]
    trust_region_radius: Option<f64>,
    /// Past steps that L-BFGS remembers (lbfgs only) [default: 20]
    #[arg(long, value_name = "N")]
    lbfgs_rank: Option<u32>,
    /// Style to start from: mean, what the bundled regressor or another's .safetensors file sees in the frames, or an earlier result's
    /// folder [default: mean]
    #[arg(long, value_name = "mean|regressor|FILE|RESULT")]
    init_style: Option<String>,
    /// Poses to start from: templates, or an earlier result's folder [default: templates]
    #[arg(long, value_name = "templates|RESULT")]
    init_pose: Option<String>,
    /// Pose hypotheses that each get a short solve with the default weights [default: 8; the paper keeps the one of best IoU]
    #[arg(long, value_name = "N")]
    hypotheses: Option<usize>,
    /// Threads over hypotheses; the result does not depend on it [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
}

#[derive(clap::Args)]
#[command(next_help_heading = "Objective")]
struct ObjectiveArgs {
    /// Weight of the photometric term [default: 1e-4; the paper's is 1]
    #[arg(long, value_name = "WEIGHT")]
    photometric_weight: Option<f64>,
    /// δ1, Huber width of a colour difference in levels of 0 to 255 [default: 20; the paper's is 100]
    #[arg(long, value_name = "WIDTH")]
    photometric_huber: Option<f64>,
    /// λ1, weight of the silhouettes' Chamfer distance, in pixels of a fixed object size (silhouette_size) [default: 1.6; the paper's is 0.1]
    #[arg(long, value_name = "WEIGHT")]
    silhouette_weight: Option<f64>,
    /// Cauchy scale of a silhouette correspondence in such pixels; 0 = none [default: 1; the paper has none]
    #[arg(long, value_name = "WIDTH")]
    silhouette_cauchy: Option<f64>,
    /// Distance of a silhouette correspondence in such pixels that counts as none [default: 1; the paper's is 0]
    #[arg(long, value_name = "PIXELS")]
    silhouette_tolerance: Option<f64>,
    /// λ2, weight of the inverse-depth term [default: 4e4; the paper's is 1000]
    #[arg(long, value_name = "WEIGHT")]
    inverse_depth_weight: Option<f64>,
    /// δ2, Huber width of an inverse-depth difference [default: 0.003; the paper's is 10]
    #[arg(long, value_name = "WIDTH")]
    inverse_depth_huber: Option<f64>,
    /// Weight of -log p(style), which keeps the shape plausible [default: 3; the paper has no such term]
    #[arg(long, value_name = "WEIGHT")]
    style_weight: Option<f64>,
    /// Standard deviation of the given poses, in diagonals of the object: the motion is held to them as closely as that; 0 = they are
    /// but a start, as in the paper [default: what the sequence says of itself, 0.005 where `prepare` made it, else 0]
    #[arg(long, value_name = "LENGTH")]
    motion_deviation: Option<f64>,
    /// Points of the prior to solve with; 0 = all [default: 8192]
    #[arg(long, value_name = "N")]
    points: Option<usize>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    Lm,
    Lbfgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum ScaleUpdateArg {
    Regression,
    Variable,
}

#[derive(Clone, Copy, ValueEnum)]
enum StrategyArg {
    Alternating,
    Joint,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut config = effective_config(args)?;
    report::check_out(&args.out)?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(config.threads)
        .build_global()
        .context("threads")?;

    let (learned, prior_info) = prior::open(&config.prior)?;
    let input = prepared(args, &prior_info.category)?;
    let began = Instant::now();
    let mut sequence = read(&input, &config.input.load_options()?)?;
    let prior: Arc<dyn ShapePrior> = Arc::new(learned.clone());
    let loading_seconds = began.elapsed().as_secs_f64();

    // The result's configuration says what was held, not where that came from.
    let deviation = config.objective.motion_deviation.or(sequence.motion_deviation);
    config.objective.motion_deviation = Some(deviation.unwrap_or(0.0));

    let style = start_style(&sequence, &learned, &prior_info, &config.start.style)?;
    let target = config.input.target_of(sequence.frames.len())?;
    let starts = starts(&sequence, &learned, &style, target, &config)?;
    let initialising_seconds = began.elapsed().as_secs_f64() - loading_seconds;

    let watch = progress::Watch::start()?;
    let mut solution = solver::solve(
        &Footage::new(&sequence, config.solver.levels)?,
        &prior,
        target,
        &starts,
        &config.objective,
        &config.solver,
        &|row| watch.see(row),
    )?;
    watch.finish();
    // What follows sees the cameras that were found.
    for frame in &mut sequence.frames {
        frame.camera = solution.estimate.camera(&frame.camera);
    }
    solution.seconds.insert(0, ("load".to_owned(), loading_seconds));
    solution
        .seconds
        .insert(1, ("initialise".to_owned(), initialising_seconds));

    let surface = Surface::from_points(learned.shape(&solution.estimate.style));
    let written = report::write(
        &ReportInput {
            sequence: &sequence,
            solution: &solution,
            surface: &surface,
            input: &args.input.display().to_string(),
            prior: &name_of(&prior_info),
            config: &config.to_toml()?,
            peak_memory_mb: report::peak_memory_mb(),
        },
        &args.out,
    )?;
    summarise(&solution, &written);
    Ok(())
}

/// The input, or the sequence folder that is made of it first: beside the result, under the input's name.
#[cfg(feature = "vision")]
fn prepared(args: &Args, category: &str) -> anyhow::Result<PathBuf> {
    if spba_ceres::sequence::recognises(&args.input)
        || args.input.is_dir() && Input::find(&args.input).is_err()
    {
        if let Some(flag) = args.raw.given() {
            anyhow::bail!("{flag}: only for a video or a folder of pictures; leave it out");
        }
        return Ok(args.input.clone());
    }
    let folder = made_beside(&args.out, &args.input);
    super::prepare::prepare(
        &args.input,
        &args.raw,
        Some(category),
        &folder,
        super::prepare::IfMade::Replace,
    )?;
    Ok(folder)
}

#[cfg(not(feature = "vision"))]
fn prepared(args: &Args, _category: &str) -> anyhow::Result<PathBuf> {
    Ok(args.input.clone())
}

/// As results name a prior.
fn name_of(prior: &PriorInfo) -> String {
    format!("{} {} (schema {})", prior.category, prior.kind, prior.schema)
}

/// The style that `--init-style` names.
fn start_style(
    sequence: &Sequence,
    prior: &LearnedPrior,
    prior_info: &PriorInfo,
    from: &str,
) -> anyhow::Result<Vec<f64>> {
    match from {
        "mean" => Ok(vec![0.0; prior.style_len()]),
        "regressor" => Ok(regressor::bundled(&prior_info.category)?.style(sequence, prior_info)?),
        file if file.ends_with(".safetensors") => {
            Ok(regressor::load(Path::new(file))?.style(sequence, prior_info)?)
        }
        folder => {
            let result = RunResult::load(Path::new(folder)).context("--init-style")?;
            anyhow::ensure!(
                result.prior == name_of(prior_info),
                "--init-style {folder}: its prior is `{}`, this one `{}`: give a result of the same prior",
                result.prior,
                name_of(prior_info)
            );
            Ok(result.style)
        }
    }
}

/// What the solver starts from.
fn starts(
    sequence: &Sequence,
    prior: &LearnedPrior,
    style: &[f64],
    target: usize,
    config: &Config,
) -> anyhow::Result<Vec<Initialisation>> {
    let pose = &config.start.pose;
    if pose == "templates" {
        return Ok(init::initialise(sequence, prior, style, target, &config.init)?);
    }
    let result = RunResult::load(Path::new(pose)).context("--init-pose")?;
    let of_frame = |frame: &Frame| {
        let known = result.frames.iter().find(|known| known.name == frame.name);
        let found = known.and_then(FrameResult::camera_from_object);
        found.with_context(|| {
            format!(
                "--init-pose {pose}: no frame `{}`: give a result of all frames in use",
                frame.name
            )
        })
    };
    let cameras = sequence
        .frames
        .iter()
        .map(of_frame)
        .collect::<anyhow::Result<Vec<_>>>()?;
    let alpha = result.alpha.unwrap_or(1.0);
    Ok(vec![init::initialise_at(
        sequence,
        prior,
        style,
        target,
        &cameras,
        alpha,
        &config.init,
    )?])
}

/// Flag over file over default.
fn effective_config(args: &Args) -> anyhow::Result<Config> {
    let mut config = args
        .config
        .as_deref()
        .map(Config::load)
        .transpose()?
        .unwrap_or_default();
    fn set<T: Clone>(target: &mut T, flag: &Option<T>) {
        if let Some(value) = flag {
            *target = value.clone();
        }
    }
    set(&mut config.prior, &args.prior);
    set(&mut config.threads, &args.threads);
    if args.depth.is_some() {
        config.input.depth.clone_from(&args.depth);
    }
    set(&mut config.input.frames, &args.frames);
    set(&mut config.input.every, &args.every);
    if args.target.is_some() {
        config.input.target = args.target;
    }
    set(&mut config.start.style, &args.init_style);
    set(&mut config.start.pose, &args.init_pose);
    set(&mut config.init.hypotheses.count, &args.hypotheses);
    let objective = &mut config.objective;
    set(
        &mut objective.photometric_weight,
        &args.objective.photometric_weight,
    );
    set(
        &mut objective.photometric_huber,
        &args.objective.photometric_huber,
    );
    set(
        &mut objective.silhouette_weight,
        &args.objective.silhouette_weight,
    );
    set(
        &mut objective.silhouette_cauchy,
        &args.objective.silhouette_cauchy,
    );
    set(
        &mut objective.silhouette_tolerance,
        &args.objective.silhouette_tolerance,
    );
    set(
        &mut objective.inverse_depth_weight,
        &args.objective.inverse_depth_weight,
    );
    set(
        &mut objective.inverse_depth_huber,
        &args.objective.inverse_depth_huber,
    );
    set(&mut objective.style_weight, &args.objective.style_weight);
    objective.motion_deviation = args.objective.motion_deviation.or(objective.motion_deviation);
    set(&mut objective.points, &args.objective.points);
    let solver = &mut config.solver;
    set(&mut solver.levels, &args.levels);
    set(&mut solver.max_steps, &args.max_steps);
    set(&mut solver.iterations_per_call, &args.iterations);
    set(&mut solver.threshold, &args.threshold);
    set(&mut solver.tolerance, &args.tolerance);
    match args.scale_update {
        Some(ScaleUpdateArg::Regression) => solver.scale_update = ScaleUpdate::Regression,
        Some(ScaleUpdateArg::Variable) => solver.scale_update = ScaleUpdate::Variable,
        None => {}
    }
    match args.strategy {
        Some(StrategyArg::Alternating) => solver.strategy = Strategy::Alternating,
        Some(StrategyArg::Joint) => solver.strategy = Strategy::Joint,
        None => {}
    }
    match args.solver {
        Some(Method::Lm) if !matches!(solver.minimiser, Minimiser::Lm { .. }) => {
            solver.minimiser = Minimiser::lm(LinearSolver::Auto);
        }
        Some(Method::Lbfgs) if !matches!(solver.minimiser, Minimiser::Lbfgs { .. }) => {
            solver.minimiser = Minimiser::lbfgs(default_lbfgs_rank());
        }
        _ => {}
    }
    match (&mut solver.minimiser, args.trust_region_radius, args.lbfgs_rank) {
        (Minimiser::Lm { .. }, _, Some(_)) => {
            anyhow::bail!("--lbfgs-rank: Levenberg-Marquardt keeps no history; add --solver lbfgs or drop it")
        }
        (Minimiser::Lbfgs { .. }, Some(_), _) => {
            anyhow::bail!("--trust-region-radius: L-BFGS has no trust region; add --solver lm or drop it")
        }
        (
            Minimiser::Lm {
                initial_trust_region_radius,
                ..
            },
            Some(radius),
            None,
        ) => {
            *initial_trust_region_radius = radius;
        }
        (Minimiser::Lbfgs { rank, .. }, None, Some(wanted)) => *rank = wanted,
        _ => {}
    }
    Ok(config)
}

fn summarise(solution: &Solution, written: &report::Written) {
    let result = &written.result;
    let how = match solution.termination {
        Termination::BelowThreshold => "below the threshold",
        Termination::Converged => "converged",
        Termination::StepLimit => "stopped at the step limit",
        Termination::Interrupted => "interrupted; this is the best state so far",
    };
    println!(
        "objective        {:.1} -> {:.1}, {how} after {} iterations, {} evaluations",
        solution.objective_start.total,
        solution.objective_end.total,
        solution.iterations,
        solution.evaluations.residual + solution.evaluations.jacobian,
    );
    println!("silhouette IoU   {:.3}", result.silhouette_iou_mean);
    println!("density          {:.3}", result.density_mean);
    let seconds: Vec<String> = solution
        .seconds
        .iter()
        .map(|(stage, seconds)| format!("{stage} {seconds:.1} s"))
        .collect();
    println!("time             {}", seconds.join(", "));
    let folder = written.folder.display();
    println!("shape            {folder}/shape.ply");
    println!("cameras          {folder}/cameras.txt (TUM), {folder}/colmap/ (COLMAP), {folder}/result.json");
    println!(
        "pictures         {} (first), {folder}/overlay/",
        written.contact_sheet.display()
    );
}
