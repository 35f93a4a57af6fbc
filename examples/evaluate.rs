//! Measures a result folder against the truth of a rendered sequence.
//!
//! `cargo run --release --example evaluate RESULT [SEQUENCE]`; the truth is the bundled car's by default.

use spba_ceres::eval::{Estimated, TruthErrors, against_truth};
use spba_ceres::image::read_depth;
use spba_ceres::report::{RunResult, file_stems, read_shape};
use spba_ceres::sequence::{self, LoadOptions};
use std::error::Error;
use std::path::Path;

pub fn run(result: &Path, truth: &Path) -> Result<TruthErrors, Box<dyn Error>> {
    let rendered = sequence::load(truth, &LoadOptions::default())?;
    let truth = rendered.truth.as_ref().ok_or("the sequence has no truth")?;
    let found = RunResult::load(result)?;

    let (mut frames, mut depth) = (Vec::new(), Vec::new());
    let stems = file_stems(found.frames.iter().map(|frame| frame.name.as_str()));
    for (frame, stem) in found.frames.iter().zip(&stems) {
        let mut known = rendered.frames.iter();
        let index = known.position(|other| other.name == frame.name);
        let pose = frame.camera_from_object().ok_or("no rotation matrix")?;
        frames.push((frame.name.clone(), index.ok_or("an unknown frame")?, pose));
        depth.push(Some(read_depth(&result.join(format!("depth/{stem}.exr")))?));
    }
    let estimated = Estimated {
        frames,
        depth,
        depth_scale: 1.0, // a result's depth is in object units already
        dense: true,
        shape: Some(read_shape(&result.join("shape.ply"))?),
    };
    let errors = against_truth(&estimated, truth);
    for frame in &errors.frames {
        println!(
            "{}: orientation error {:.2}°, location error {:.2} % of the diagonal",
            frame.name, frame.orientation_error_deg, frame.location_error_percent
        );
    }
    Ok(errors)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let result = arguments
        .next()
        .ok_or("give a result folder, as `--example solve` writes it")?;
    let truth = arguments.next().unwrap_or("data/sequences/car".into());
    run(Path::new(&result), Path::new(&truth))?;
    Ok(())
}
