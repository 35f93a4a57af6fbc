//! The objective (Eq. 9), its gradient and its Gauss–Newton matrix at an estimate, for a minimiser of your own.
//!
//! `cargo run --release --example objective`

use spba_ceres::init::{InitOptions, initialise};
use spba_ceres::objective::{Footage, Objective, ObjectiveOptions};
use spba_ceres::prior::{self, ShapePrior};
use spba_ceres::sequence::{self, LoadOptions};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// A step of the style, which is in standard deviations.
const STEP: f64 = 1e-5;

/// The derivative by the first style entry, from the gradient and from central differences.
pub fn run(input: &Path) -> Result<[f64; 2], Box<dyn Error>> {
    let sequence = sequence::load(input, &LoadOptions::default())?;
    let prior: Arc<dyn ShapePrior> = Arc::new(prior::find("car")?);
    let target = sequence.frames.len() / 2;
    let mean = vec![0.0; prior.style_len()];
    let coarse = InitOptions {
        points: 512,
        ..InitOptions::default()
    };
    let starts = initialise(&sequence, prior.as_ref(), &mean, target, &coarse)?;
    let mut estimate = starts.into_iter().next().ok_or("no start")?.estimate;

    let footage = Footage::new(&sequence, 1)?;
    let options = ObjectiveOptions::default();
    let mut objective = Objective::new(&footage, prior.clone(), &options, target, &estimate, 1)?;
    // Which points and pixels are compared: held while derivatives are taken.
    let visibility = objective.visibility(&estimate, 0)?;
    println!("{:#?}", objective.evaluate(&estimate, &visibility)?);

    // [ω_l; t_l] of every frame, then s, log α and the logarithm of the focal factor.
    let (gradient, matrix) = objective.differentiate(&estimate, &visibility)?;
    assert_eq!(gradient.len().pow(2), matrix.len());
    let by_style = gradient[6 * sequence.frames.len()];

    let mut at = |style: f64| {
        estimate.style[0] = style;
        objective
            .evaluate(&estimate, &visibility)
            .map(|value| value.total)
    };
    let difference = (at(STEP)? - at(-STEP)?) / (2.0 * STEP);
    println!("derivative by the first style entry: {by_style:.3}, by differences {difference:.3}");
    Ok([by_style, difference])
}

fn main() -> Result<(), Box<dyn Error>> {
    run(Path::new("data/sequences/car"))?;
    Ok(())
}
