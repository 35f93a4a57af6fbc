//! `spba-ceres render`: CAD models into pictures.

use anyhow::Context;
use serde::Deserialize;
use spba_ceres::cad::{self, SourceSpec};
use spba_ceres::image::RgbImage;
use std::path::{Path, PathBuf};

/// Render a sequence with full ground truth from a CAD model.
#[derive(clap::Args)]
pub struct Args {
    /// TOML list of [[source]] tables: draw every model of theirs on one PNG instead.
    #[arg(long, value_name = "SOURCES.toml")]
    sheet: PathBuf,

    /// Where to write.
    #[arg(long)]
    out: PathBuf,
}

/// The file of `--sheet`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sources {
    source: Vec<SourceSpec>,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    sheet(&args.sheet, &args.out)
}

fn sheet(list: &Path, out: &Path) -> anyhow::Result<()> {
    const COLUMNS: usize = 3;
    const SIZE_PX: usize = 192;
    let text = std::fs::read_to_string(list).with_context(|| format!("{}", list.display()))?;
    let sources: Sources = toml::from_str(&text).with_context(|| format!("{}", list.display()))?;
    let mut models = Vec::new();
    for source in &sources.source {
        models.extend(cad::load_source(source)?);
    }
    save(&cad::contact_sheet(&models, COLUMNS, SIZE_PX), out)?;
    println!("{}, row by row:", out.display());
    for model in &models {
        println!("  {} ({}; {})", model.name, model.source, model.licence);
    }
    Ok(())
}

fn save(picture: &RgbImage, path: &Path) -> anyhow::Result<()> {
    let (width, height) = picture.size();
    let bytes: Vec<u8> = picture
        .data()
        .iter()
        .flatten()
        .map(|value| value.round().clamp(0.0, 255.0) as u8)
        .collect();
    let partial = path.with_extension("partial.png");
    image::save_buffer(
        &partial,
        &bytes,
        width as u32,
        height as u32,
        image::ColorType::Rgb8,
    )
    .and_then(|()| Ok(std::fs::rename(&partial, path)?))
    .with_context(|| format!("{}", path.display()))
}
