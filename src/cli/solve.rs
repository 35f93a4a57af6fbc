//! `spba-ceres solve`.

#[cfg(feature = "vision")]
use super::input::made_beside;
use super::input::read;
#[cfg(feature = "vision")]
use super::prepare::RawArgs;
use super::progress;
use super::starts::{self, Template};
use super::summary::summarise;
use anyhow::Context;
use serde::Serialize;
use spba_ceres::config::{Config, ConfigError, Setting};
#[cfg(feature = "vision")]
use spba_ceres::init;
use spba_ceres::init::Initialisation;
use spba_ceres::objective::Footage;
#[cfg(feature = "vision")]
use spba_ceres::prepare::{Input, PrepareError};
use spba_ceres::prior::{self, LearnedPrior, ShapePrior};
use spba_ceres::report::{self, ReportInput, Surface};
use spba_ceres::sequence::Sequence;
use spba_ceres::solver;
#[cfg(feature = "vision")]
use spba_ceres::solver::Termination;
use spba_ceres::solver::{Solution, SolveError};
#[cfg(any(feature = "vision", feature = "rerun"))]
use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Recover an object's full shape and every camera from a sequence.
///
/// INPUT is a sequence folder (`sequence.toml`), a COLMAP workspace (`images/`, `sparse/`, `masks/`, perhaps
/// `stereo/depth_maps/`), or a video or folder of pictures, of which a sequence folder is made first, beside the result; it stays for
/// the next run. A flag overrides --set, which overrides the configuration file, which overrides the defaults.
#[derive(clap::Args)]
#[command(
    after_help = "Keys: --print-config prints every key of the configuration with its value. --set reaches each of them, \
    such as --set objective.style_weight=0 --set solver.minimiser.method=lbfgs --set objective.pairs.offsets=[1,2,4]."
)]
pub struct Args {
    /// Sequence folder, COLMAP workspace, video or folder of pictures
    #[arg(required_unless_present = "print_config")]
    input: Option<PathBuf>,
    /// Folder for the result; must not exist
    #[arg(long, short, required_unless_present = "print_config")]
    out: Option<PathBuf>,
    /// Shape prior: the name of a bundled one, or a file [default: car]
    #[arg(long)]
    prior: Option<String>,
    /// TOML file with any of the keys that --print-config shows
    #[arg(long)]
    config: Option<PathBuf>,
    /// Any key of the configuration, dotted, with a value in TOML; a bare word is a string. May be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print the configuration that the other options give, as a file for --config, and end
    #[arg(long)]
    print_config: bool,
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
    /// Standard deviation of the given poses, in diagonals of the object: the motion is held to them as closely as that; 0 = they are
    /// but a start, as in the paper [default: what the sequence says of itself, 0.001 where `prepare` made it, else 0]
    #[arg(long, value_name = "LENGTH")]
    motion_deviation: Option<f64>,
    /// Style to start from: mean, what the bundled regressor or another's .safetensors file sees in the frames, or an earlier result's
    /// folder [default: mean]
    #[arg(long, value_name = "mean|regressor|FILE|RESULT")]
    init_style: Option<String>,
    /// Poses to start from: templates, or an earlier result's folder [default: templates]
    #[arg(long, value_name = "templates|RESULT")]
    init_pose: Option<String>,
    /// Ceres minimiser [default: lm; the paper uses lbfgs]
    #[arg(long, value_parser = ["lm", "lbfgs"])]
    solver: Option<String>,
    /// Which variables move together: all (joint), or p0, motion and style in turn as in Algorithm 1
    /// (alternating) [default: joint; the paper alternates]
    #[arg(long, value_parser = ["joint", "alternating"])]
    strategy: Option<String>,
    /// Pose hypotheses that each get a short solve [default: 8; the paper keeps the one of best IoU]
    #[arg(long, value_name = "N")]
    hypotheses: Option<usize>,
    /// Points of the prior to solve with; 0 = all [default: 8192]
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Pyramid levels [default: 3; the paper mentions none]
    #[arg(long, value_name = "N")]
    levels: Option<usize>,
    /// Steps of Algorithm 1 per pyramid level [default: 20]
    #[arg(long, value_name = "N")]
    max_steps: Option<usize>,
    /// The object's real length from front to back: mesh.glb is then in metres [default: unknown, mesh.glb is in diagonals]
    #[arg(long, value_name = "METRES")]
    length: Option<f64>,
    /// Also record pictures, cameras and the mesh over the solver's steps into this file (.rrd) for the rerun viewer
    #[cfg(feature = "rerun")]
    #[arg(long, value_name = "FILE")]
    rrd: Option<PathBuf>,
    /// Threads over hypotheses; the result does not depend on it [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[cfg(feature = "vision")]
    #[command(flatten)]
    raw: RawArgs,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut config = effective_config(args)?;
    // Without --print-config clap demands the two.
    let (false, Some(input), Some(out)) = (args.print_config, &args.input, &args.out) else {
        print!("{}", config.to_toml()?);
        return Ok(());
    };
    report::check_out(out)?;
    #[cfg(feature = "rerun")]
    if let Some(rrd) = &args.rrd {
        let folder = rrd.parent().filter(|folder| *folder != Path::new(""));
        anyhow::ensure!(
            folder.is_none_or(Path::is_dir),
            "--rrd {}: its folder does not exist; make it first",
            rrd.display()
        );
    }
    start_threads(&mut config)?;
    let priors = prior::open_all(&config.prior)?;
    #[cfg(feature = "vision")]
    let prepared = &prepared(input, out, &args.raw, &priors[0].1.category)?;
    #[cfg(not(feature = "vision"))]
    let prepared = input;
    let began = Instant::now();
    let mut sequence = read(prepared, &config.input.load_options()?)?;
    let loading_seconds = began.elapsed().as_secs_f64();

    say_what_is_held(&mut config, &sequence);
    let target = config.input.target_of(sequence.frames.len())?;
    let templates = starts::templates(&sequence, priors, target, &config)?;
    let initialising_seconds = began.elapsed().as_secs_f64() - loading_seconds;
    let several = templates.len() > 1;
    let Template {
        prior: learned,
        info: prior_info,
        starts,
    } = starts::best(&sequence, templates, target, &config)?;
    let competing_seconds = began.elapsed().as_secs_f64() - loading_seconds - initialising_seconds;

    let problem = Problem {
        prior: learned.clone(),
        target,
        config: &config,
    };
    let found = (problem.solve(&sequence, &starts)?, Vec::new());
    #[cfg(feature = "vision")]
    let found = match prepared != input {
        true => {
            let style = &starts[0].estimate.style;
            problem.mend_masks(&mut sequence, style, found.0, &args.raw, &prior_info.category)?
        }
        false => found,
    };
    let (mut solution, masks_anew): (Solution, Vec<String>) = found;
    // What follows sees the cameras that were found.
    sequence = sequence.edited(|content| {
        for frame in &mut content.frames {
            frame.camera = solution.estimate.camera(&frame.camera);
        }
    })?;
    solution.seconds.insert(0, ("load".to_owned(), loading_seconds));
    solution
        .seconds
        .insert(1, ("initialise".to_owned(), initialising_seconds));
    if several {
        let competing = ("templates".to_owned(), competing_seconds);
        solution.seconds.insert(2, competing);
    }

    let surface = Surface::of(&learned, &solution);
    let written = report::write(
        &ReportInput {
            sequence: &sequence,
            solution: &solution,
            surface: &surface,
            input: &input.display().to_string(),
            prior: &prior_info.name(),
            length_m: config.output.length_m,
            masks_anew: &masks_anew,
            config: &config.to_toml()?,
            focal_deviation: config.objective.focal_deviation.unwrap_or(0.0),
            peak_memory_mb: report::peak_memory_mb(),
        },
        out,
    )?;
    summarise(&solution, &written, surface.mesh().is_some());
    #[cfg(feature = "rerun")]
    if let Some(rrd) = &args.rrd {
        report::write_recording(&sequence, &learned, &solution, &surface, rrd)?;
        println!("recording        {} (for the rerun viewer)", rrd.display());
    }
    for words in &written.doubts.words {
        println!("IN DOUBT         {words}");
    }
    #[cfg(feature = "vision")]
    if prepared != input {
        args.raw.warn_without_networks();
    }
    anyhow::ensure!(
        written.doubts.explained,
        "{}: not usable: no likely shape of the prior, seen with a likely focal length, explains the masks; see what is IN DOUBT above",
        out.display()
    );
    Ok(())
}

/// As many as the configuration says, or one per core.
fn start_threads(config: &mut Config) -> anyhow::Result<()> {
    config.solver.threads = match config.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(config.threads)
        .build_global()
        .context("threads")
}

/// The result's configuration says what was held, not where that came from.
fn say_what_is_held(config: &mut Config, sequence: &Sequence) {
    for (held, said) in [
        (&mut config.objective.motion_deviation, sequence.motion_deviation),
        (&mut config.objective.focal_deviation, sequence.focal_deviation),
    ] {
        *held = Some(held.or(said).unwrap_or(0.0));
    }
}

/// The input, or the sequence folder that is made of it first: beside the result, under the input's name.
#[cfg(feature = "vision")]
fn prepared(input: &Path, out: &Path, raw: &RawArgs, category: &str) -> anyhow::Result<PathBuf> {
    let is_sequence = || {
        // A folder without any picture is told what else it could be.
        spba_ceres::sequence::recognises(input)
            || matches!(Input::find(input), Err(PrepareError::NoPictures(_)))
    };
    if is_sequence() {
        if let Some(flag) = raw.given() {
            anyhow::bail!("{flag}: only for a video or a folder of pictures; leave it out");
        }
        return Ok(input.to_owned());
    }
    let folder = made_beside(out, input);
    super::prepare::prepare(
        input,
        raw,
        Some(category),
        &folder,
        super::prepare::IfMade::Replace,
    )?;
    Ok(folder)
}

/// What is solved, whatever the masks.
struct Problem<'a> {
    prior: Arc<LearnedPrior>,
    /// The paper's target frame.
    target: usize,
    config: &'a Config,
}

impl Problem<'_> {
    /// From the best of the starts, with a progress bar.
    fn solve(&self, sequence: &Sequence, starts: &[Initialisation]) -> anyhow::Result<Solution> {
        let progress = progress::SolveProgress::start()?;
        let prior: Arc<dyn ShapePrior> = self.prior.clone();
        let solution = solver::solve(
            &Footage::new(sequence, self.config.solver.levels)?,
            &prior,
            self.target,
            starts,
            &self.config.objective,
            &self.config.solver,
            &|row| progress.see(row),
        )?;
        progress.finish();
        Ok(solution)
    }

    /// The solve gone on with masks decided anew where the shape does not explain them, which become the sequence's, and the names of their frames.
    #[cfg(feature = "vision")]
    fn mend_masks(
        &self,
        sequence: &mut Sequence,
        style: &[f64],
        solution: Solution,
        raw: &RawArgs,
        category: &str,
    ) -> anyhow::Result<(Solution, Vec<String>)> {
        if solution.termination == Termination::Interrupted {
            return Ok((solution, Vec::new()));
        }
        let Some((mended, names)) = with_masks_by_shape(sequence, &self.prior, &solution, raw, category)?
        else {
            return Ok((solution, Vec::new()));
        };
        println!(
            "{:16} decided anew where the shape did not explain them: {}",
            "masks",
            names.join(", ")
        );
        let solution = self.solve_from(&mended, style, solution)?;
        *sequence = mended;
        Ok((solution, names))
    }

    /// Again, from the cameras that were found with other masks, and the style from `style`.
    #[cfg(feature = "vision")]
    fn solve_from(&self, sequence: &Sequence, style: &[f64], earlier: Solution) -> anyhow::Result<Solution> {
        let found = &earlier.estimate;
        let mut start = init::initialise_at(
            sequence,
            self.prior.as_ref(),
            (style, &[]),
            self.target,
            &found.camera_from_object,
            found.alpha,
            &self.config.init,
        )?;
        start.estimate.focal_factor = found.focal_factor;
        Ok(self.solve(sequence, &[start])?.after(earlier))
    }
}

/// The sequence with masks that its solved shape explains better, and the names of the frames whose masks these are.
#[cfg(feature = "vision")]
fn with_masks_by_shape(
    sequence: &Sequence,
    prior: &LearnedPrior,
    solution: &Solution,
    raw: &RawArgs,
    category: &str,
) -> anyhow::Result<Option<(Sequence, Vec<String>)>> {
    let Some(options) = raw.mask_options_where_made(category) else {
        return Ok(None);
    };
    let surface = Surface::of(prior, solution);
    let interrupted = progress::interruption()?;
    let progress = progress::Progress::new();
    let masks =
        spba_ceres::prepare::masks_by_shape(sequence, &surface, &solution.estimate, &options, &|steps| {
            progress.advance("masks by the shape", steps);
            !interrupted.load(std::sync::atomic::Ordering::SeqCst)
        });
    progress.finish();
    let masks = match masks {
        // What was solved is worth keeping.
        Err(PrepareError::Interrupted) => return Ok(None),
        masks => masks?,
    };
    let named = sequence.frames.iter().zip(&masks);
    let names: Vec<String> = named
        .filter(|(_, mask)| mask.is_some())
        .map(|(frame, _)| frame.name.clone())
        .collect();
    if names.is_empty() {
        return Ok(None);
    }
    let mended = sequence.clone().edited(|content| {
        for (frame, mask) in content.frames.iter_mut().zip(masks) {
            if let Some(mask) = mask {
                frame.mask = mask;
            }
        }
    })?;
    Ok(Some((mended, names)))
}

/// Flag over --set over file over default.
fn effective_config(args: &Args) -> anyhow::Result<Config> {
    let mut settings = Vec::new();
    for text in &args.set {
        settings.push(text.parse()?);
    }
    let given = &mut settings;
    add_flag(given, "--prior", "prior", &args.prior)?;
    add_flag(given, "--depth", "input.depth", &args.depth)?;
    add_flag(given, "--frames", "input.frames", &args.frames)?;
    add_flag(given, "--every", "input.every", &args.every)?;
    add_flag(given, "--target", "input.target", &args.target)?;
    add_flag(
        given,
        "--motion-deviation",
        "objective.motion_deviation",
        &args.motion_deviation,
    )?;
    add_flag(given, "--init-style", "start.style", &args.init_style)?;
    add_flag(given, "--init-pose", "start.pose", &args.init_pose)?;
    add_flag(given, "--solver", "solver.minimiser.method", &args.solver)?;
    add_flag(given, "--strategy", "solver.strategy", &args.strategy)?;
    add_flag(given, "--hypotheses", "init.hypotheses.count", &args.hypotheses)?;
    add_flag(given, "--points", "objective.points", &args.points)?;
    add_flag(given, "--levels", "solver.levels", &args.levels)?;
    add_flag(given, "--max-steps", "solver.max_steps", &args.max_steps)?;
    add_flag(given, "--threads", "threads", &args.threads)?;
    add_flag(given, "--length", "output.length_m", &args.length)?;
    let config = Config::layered(args.config.as_deref(), &settings)?;
    // The library looks too, but a video takes minutes to get there.
    let out_of_range = |(key, why)| SolveError::Option(key, why);
    config.objective.check().map_err(out_of_range)?;
    config.solver.check().map_err(out_of_range)?;
    config.output.check().map_err(out_of_range)?;
    Ok(config)
}

fn add_flag(
    settings: &mut Vec<Setting>,
    flag: &str,
    key: &str,
    value: &Option<impl Serialize>,
) -> Result<(), ConfigError> {
    if let Some(value) = value {
        settings.push(Setting::of_flag(flag, key, value)?);
    }
    Ok(())
}
