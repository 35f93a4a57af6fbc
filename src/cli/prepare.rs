//! `spba-ceres prepare`, and what `solve` does with a video or pictures.

use super::progress::{Progress, interruption};
use spba_ceres::prepare::{
    self, Cache, Focal, MaskOptions, ObjectBox, PhotoOptions, PrepareOptions, Prepared, Stamp,
};
use spba_ceres::report;
use spba_ceres::sequence::{self, LoadOptions, SequenceError};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Make a sequence folder of a video or a folder of pictures: masks, camera motion and depth.
#[derive(clap::Args)]
pub struct Args {
    /// A video, or a folder of PNG or JPEG pictures
    input: PathBuf,
    #[command(flatten)]
    raw: RawArgs,
    /// What the object is, for --networks that know classes: car, chair, airplane [default: whatever stands out]
    #[arg(long, value_name = "NAME")]
    category: Option<String>,
    /// Write a contact sheet, review.png, into the sequence folder: every frame with its mask and depth
    #[arg(long)]
    review: bool,
    /// The sequence folder to make; one that this command made of the same input is left as it is
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// What a video or pictures need.
#[derive(clap::Args)]
#[command(next_help_heading = "Videos and pictures")]
pub struct RawArgs {
    /// Focal length: pixels (1200), or its equivalent on 35 mm film (26mm) [default: from EXIF data, or found with the motion]
    #[arg(long, value_name = "PX|mm")]
    focal: Option<Focal>,
    /// Around the object in the middle frame, in pixels [default: where something moves]
    #[arg(long = "box", value_name = "X,Y,W,H")]
    object_box: Option<ObjectBox>,
    /// Folder of masks (white = object), named like the pictures
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["object_box", "networks"])]
    masks: Option<PathBuf>,
    /// Folder of networks that find the object, or `none` [default: where scripts/fetch_networks puts them, if they are there]
    #[arg(long, value_name = "FOLDER")]
    networks: Option<PathBuf>,
    /// At most so many frames: of as many groups in a row, the sharpest each [default: 40]
    #[arg(long, value_name = "N")]
    max_frames: Option<usize>,
    /// Larger pictures are made smaller, so that the longer side has so many pixels [default: 960]
    #[arg(long, value_name = "PIXELS")]
    max_size: Option<usize>,
}

impl RawArgs {
    /// The first flag that was given.
    pub fn given(&self) -> Option<&'static str> {
        [
            (self.focal.is_some(), "--focal"),
            (self.object_box.is_some(), "--box"),
            (self.masks.is_some(), "--masks"),
            (self.networks.is_some(), "--networks"),
            (self.max_frames.is_some(), "--max-frames"),
            (self.max_size.is_some(), "--max-size"),
        ]
        .into_iter()
        .find_map(|(given, flag)| given.then_some(flag))
    }

    /// The folder of networks to use.
    fn networks(&self) -> Option<PathBuf> {
        match &self.networks {
            _ if self.masks.is_some() => None,
            Some(folder) if folder.as_os_str() == "none" => None,
            Some(folder) => Some(folder.clone()),
            None => default_networks().filter(|folder| folder.is_dir()),
        }
    }

    /// Says that masks are made by colours alone, if so: before the work and again at its end, where it is read.
    pub fn warn_without_networks(&self) {
        if self.masks.is_none() && self.networks().is_none() {
            eprintln!(
                "warning: masks by colours alone, which often go wrong; mend it: run `scripts/fetch_networks` once, \
                 which gets networks that find objects"
            );
        }
    }

    /// How masks are made; `None` where they are given.
    pub fn mask_options_where_made(&self, category: &str) -> Option<MaskOptions> {
        self.masks.is_none().then(|| self.mask_options(Some(category)))
    }

    fn mask_options(&self, category: Option<&str>) -> MaskOptions {
        MaskOptions {
            given: self.masks.clone(),
            object_box: self.object_box,
            networks: self.networks(),
            category: category.map(str::to_owned),
        }
    }

    fn options(&self, category: Option<&str>) -> PrepareOptions {
        let photos = PhotoOptions::default();
        PrepareOptions {
            photos: PhotoOptions {
                max_frames: self.max_frames.unwrap_or(photos.max_frames),
                longest_px: self.max_size.unwrap_or(photos.longest_px),
            },
            focal: self.focal,
            masks: self.mask_options(category),
            ..PrepareOptions::default()
        }
    }
}

/// Where scripts/fetch_networks puts what it fetched unless told otherwise.
fn default_networks() -> Option<PathBuf> {
    let of = |variable: &str| {
        std::env::var_os(variable)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let data = of("XDG_DATA_HOME").or_else(|| Some(of("HOME")?.join(".local/share")))?;
    Some(data.join("spba-ceres/networks"))
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    prepare(
        &args.input,
        &args.raw,
        args.category.as_deref(),
        &args.out,
        IfMade::Refuse,
    )?;
    if args.review {
        let sheet = args.out.join("review.png");
        report::write_review(&sequence::load(&args.out, &LoadOptions::default())?, &sheet)?;
        println!("{:16} {}", "review", sheet.display());
    }
    args.raw.warn_without_networks();
    Ok(())
}

/// What to do with a sequence folder that this command made of another input or with other options.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum IfMade {
    Refuse,
    Replace,
}

/// Makes `out` of a video or pictures, unless that is what it holds already. Says what each stage did; what the stages made is
/// kept in `<out>.cache` for runs with other options and after an interruption.
pub fn prepare(
    input: &Path,
    raw: &RawArgs,
    category: Option<&str>,
    out: &Path,
    if_made: IfMade,
) -> anyhow::Result<()> {
    raw.warn_without_networks();
    let interrupted = interruption()?;
    let options = raw.options(category);
    let stamp = Stamp::new(input, &options)?;
    prepare::remove_stale(out);
    let exists = out.symlink_metadata().is_ok();
    match Stamp::load(out) {
        Some(found) if found == stamp => {
            println!("{}: made of this input already", out.display());
            return Ok(());
        }
        Some(_) if if_made == IfMade::Replace => {}
        _ => anyhow::ensure!(!exists, SequenceError::TargetExists(out.to_owned())),
    }
    let progress = Progress::new();
    let mut folder = out.as_os_str().to_owned();
    folder.push(".cache");
    let cache = Cache::new(folder.into());
    let Prepared { sequence, stages } = prepare::prepare(input, &options, &cache, &|stage, steps| {
        progress.advance(stage, steps);
        !interrupted.load(Ordering::SeqCst)
    })?;
    progress.finish();
    for stage in &stages {
        let memory = stage.peak_memory_mb.map(|mb| format!(", {mb:.0} MB"));
        println!(
            "{:16} {} ({:.1} s{})",
            stage.name,
            stage.words,
            stage.seconds,
            memory.unwrap_or_default()
        );
    }
    prepare::save(&sequence, &stamp, out, &cache)?;
    println!("{:16} {}", "sequence", out.display());
    Ok(())
}
