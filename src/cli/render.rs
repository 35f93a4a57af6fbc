//! `spba-ceres render`: CAD models into pictures.

use anyhow::Context;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use spba_ceres::cad::scene::{self, Scene};
use spba_ceres::cad::{self, SourceSpec};
use spba_ceres::image;
use spba_ceres::sequence;
use std::path::{Path, PathBuf};

/// Render a sequence with full ground truth from a CAD model.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (TOML): a model, the camera's path, light, noise; see data/README.md.
    #[arg(required_unless_present = "sheet")]
    scene: Option<PathBuf>,

    /// Instead of a scene: draw every model of these [[source]] tables on one PNG, to check them by eye.
    #[arg(long, value_name = "SOURCES.toml", conflicts_with = "scene")]
    sheet: Option<PathBuf>,

    /// The sequence folder to make (or, with --sheet, the PNG).
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
}

/// The file of `--sheet`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sources {
    source: Vec<SourceSpec>,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    match (&args.scene, &args.sheet) {
        (Some(file), _) => film(file, &args.out),
        (None, Some(list)) => sheet(list, &args.out),
        (None, None) => anyhow::bail!("give a scene file or --sheet"),
    }
}

fn film(file: &Path, out: &Path) -> anyhow::Result<()> {
    let scene: Scene = parse(file)?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let sequence = scene::synthesise(&scene, &name).with_context(|| file.display().to_string())?;
    sequence::write(&sequence, out)?;
    println!("{}: {} frames", out.display(), sequence.frames.len());
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
