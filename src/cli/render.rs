//! `spba-ceres render`: CAD models into pictures.

use anyhow::Context;
use clap::ValueEnum;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use spba_ceres::cad::scene::{self, Benchmark, Scene};
use spba_ceres::cad::{self, SourceSpec};
use spba_ceres::image;
use spba_ceres::sequence;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Render sequences with full ground truth from CAD models.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("what").required(true).args(["scene", "benchmark", "sheet"])))]
pub struct Args {
    /// Scene file (TOML): a model, the camera's path, light, noise; see docs/formats.md.
    scene: Option<PathBuf>,

    /// Instead of a scene: a list of them (TOML), each to be made with several numbers of frames; those that are there
    /// already are left alone.
    #[arg(long, value_name = "LIST.toml")]
    benchmark: Option<PathBuf>,

    /// Instead of a scene: draw every model of these [[source]] tables on one PNG, to check them by eye.
    #[arg(long, value_name = "SOURCES.toml")]
    sheet: Option<PathBuf>,

    /// The sequence folder to make (with --benchmark, the folder of all <name>-<frames>; with --sheet, the PNG).
    #[arg(long, value_name = "PATH")]
    out: PathBuf,

    /// With --benchmark: only these numbers of frames [default: the list's].
    #[arg(long, value_name = "L,...", value_delimiter = ',', requires = "benchmark")]
    frames: Vec<usize>,

    /// What draws the frames, their masks and true depth [default: the scene's `via`].
    #[arg(long, conflicts_with = "sheet")]
    via: Option<Via>,
}

/// See [`scene::Via`].
#[derive(Clone, Copy, ValueEnum)]
enum Via {
    Own,
    Blender,
}

/// The file of `--sheet`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sources {
    source: Vec<SourceSpec>,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    match (&args.scene, &args.benchmark, &args.sheet) {
        (Some(file), _, _) => film(file, parse(file)?, args.via, &args.out),
        (_, Some(list), _) => benchmark(list, args),
        (_, _, Some(list)) => sheet(list, &args.out),
        (None, None, None) => anyhow::bail!("give a scene file, --benchmark or --sheet"),
    }
}

fn benchmark(list: &Path, args: &Args) -> anyhow::Result<()> {
    let benchmark = Benchmark::load(list)?;
    let frames = match args.frames.as_slice() {
        [] => &benchmark.frames,
        given => given,
    };
    for &frames in frames {
        for name in benchmark.names() {
            let folder = args.out.join(format!("{name}-{frames}"));
            // Sequences are written whole or not at all.
            if folder.exists() {
                println!("{}: already there", folder.display());
                continue;
            }
            film(list, benchmark.scene(name, frames)?, args.via, &folder)?;
        }
    }
    Ok(())
}

/// `file` is where the scene comes from.
fn film(file: &Path, mut scene: Scene, via: Option<Via>, out: &Path) -> anyhow::Result<()> {
    if let Some(via) = via {
        scene.via = match via {
            Via::Own => scene::Via::Own,
            Via::Blender => scene::Via::Blender,
        };
    }
    let start = Instant::now();
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let sequence = scene::synthesise(&scene, &name).with_context(|| file.display().to_string())?;
    sequence::write(&sequence, out)?;
    println!(
        "{}: {} frames in {:.0} s",
        out.display(),
        sequence.frames.len(),
        start.elapsed().as_secs_f64()
    );
    Ok(())
}

fn parse<T: DeserializeOwned>(file: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    toml::from_str(&text).with_context(|| file.display().to_string())
}

fn sheet(list: &Path, out: &Path) -> anyhow::Result<()> {
    const COLUMNS: usize = 3;
    const SIZE_PX: usize = 192;
    let sources: Sources = parse(list)?;
    let mut models = Vec::new();
    for source in &sources.source {
        models.extend(cad::load_source(source)?);
    }
    image::write_rgb(&cad::contact_sheet(&models, COLUMNS, SIZE_PX), out)?;
    println!("{}, row by row:", out.display());
    for model in &models {
        println!("  {} ({}; {})", model.name, model.source, model.licence);
    }
    Ok(())
}
