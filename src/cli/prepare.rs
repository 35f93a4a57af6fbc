//! `spba-ceres prepare`.

use super::progress::interruption;
use indicatif::{ProgressBar, ProgressStyle};
use spba_ceres::prepare::{self, Focal, MaskOptions, ObjectBox, PhotoOptions, PrepareOptions};
use spba_ceres::sequence::{self, SequenceError};
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Make a sequence folder of a video or a folder of pictures: masks, camera motion and depth.
#[derive(clap::Args)]
pub struct Args {
    /// A video, or a folder of PNG or JPEG pictures
    input: PathBuf,
    /// Focal length: pixels (1200), or its equivalent on 35 mm film (26mm) [default: from EXIF data, or found with the motion]
    #[arg(long, value_name = "PX|mm")]
    focal: Option<Focal>,
    /// Around the object in the middle frame, in pixels [default: where something moves]
    #[arg(long = "box", value_name = "X,Y,W,H")]
    object_box: Option<ObjectBox>,
    /// Folder of masks (white = object), named like the pictures
    #[arg(long, value_name = "FOLDER")]
    masks: Option<PathBuf>,
    /// At most so many frames: of as many groups in a row, the sharpest each
    #[arg(long, value_name = "N", default_value_t = PhotoOptions::default().most)]
    max_frames: usize,
    /// Larger pictures are made smaller, so that the longer side has so many pixels
    #[arg(long, value_name = "PIXELS", default_value_t = PhotoOptions::default().longest_px)]
    max_size: usize,
    /// The sequence folder to make; must not exist
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    if args.out.symlink_metadata().is_ok() {
        return Err(SequenceError::TargetExists(args.out.clone()).into());
    }
    let options = PrepareOptions {
        photos: PhotoOptions {
            most: args.max_frames,
            longest_px: args.max_size,
        },
        focal: args.focal,
        masks: MaskOptions {
            object_box: args.object_box,
        },
        given_masks: args.masks.clone(),
        ..PrepareOptions::default()
    };
    let interrupted = interruption()?;
    let bar = ProgressBar::new(0).with_style(ProgressStyle::with_template(
        "{bar:24} {pos}/{len} {elapsed_precise} {msg}",
    )?);
    let prepared = prepare::prepare(&args.input, &options, &|stage, done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(stage);
        !interrupted.load(Ordering::SeqCst)
    })?;
    bar.finish_and_clear();
    for stage in &prepared.stages {
        println!("{:8} {} ({:.1} s)", stage.name, stage.words, stage.seconds);
    }
    sequence::write(&prepared.sequence, &args.out)?;
    println!(
        "{} frames written to {}",
        prepared.sequence.frames.len(),
        args.out.display()
    );
    Ok(())
}
