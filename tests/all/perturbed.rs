//! The bundled sequence from perturbed poses: does the solver find back, and how far?
//!
//! The figures for all 20 seeds:
//! `cargo test --release perturbed -- --ignored --nocapture`

use rayon::prelude::*;
use spba_ceres::config::Config;
use spba_ceres::eval::{Estimated, TruthErrors, against_truth};
use spba_ceres::init::Estimate;
use spba_ceres::objective::Footage;
use spba_ceres::prior::{self, ShapePrior};
use spba_ceres::report::Surface;
use spba_ceres::sequence::{self, LoadOptions, Sequence};
use spba_ceres::solver;
use spba_ceres::study::perturbed_start;
use std::path::Path;
use std::sync::Arc;

const ANGLE_DEG: f64 = 10.0;
const SHARE_OF_DISTANCE: f64 = 0.05;

fn bundled() -> Sequence {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car");
    sequence::load(&folder, &LoadOptions::default()).unwrap()
}

fn errors(sequence: &Sequence, surface: &Surface, estimate: &Estimate) -> TruthErrors {
    let estimated = Estimated::of_estimate(sequence, surface, estimate);
    against_truth(&estimated, sequence.truth.as_ref().unwrap())
}

/// Means over the frames: orientation (degrees), location (% of the diagonal) and depth error at the best scale (object units).
struct Triple {
    orientation: f64,
    location: f64,
    depth: f64,
}

impl Triple {
    /// A scale that is 2 % wrong moves a camera by 3.4 %.
    fn is_right(&self) -> bool {
        self.orientation < 1.0 && self.location < 4.0 && self.depth < 0.01
    }
}

impl From<&TruthErrors> for Triple {
    fn from(errors: &TruthErrors) -> Self {
        Self {
            orientation: errors.orientation_error_deg.unwrap().mean,
            location: errors.location_error_percent.unwrap().mean,
            depth: errors.depth_error_at_best_scale.unwrap(),
        }
    }
}

/// Solves from the seed's start and prints a line: errors at the start, errors at the end.
fn solved(seed: u64) -> (Triple, Triple) {
    let config = Config::default();
    let sequence = bundled();
    let target = config.input.target_of(sequence.frames.len()).unwrap();
    let footage = Footage::new(&sequence, config.solver.levels).unwrap();
    let prior = prior::find("car").unwrap();
    let shared: Arc<dyn ShapePrior> = Arc::new(prior.clone());
    let start = perturbed_start(&sequence, &prior, target, ANGLE_DEG, SHARE_OF_DISTANCE, seed).unwrap();
    let (surface, at_start) = Surface::of_estimate(&prior, &start);
    let before = Triple::from(&errors(&sequence, &surface, &at_start));
    let short = solver::short_solves(
        &footage,
        &shared,
        target,
        &[start],
        &config.objective,
        config.solver.evaluation,
        &|_| true,
    )
    .unwrap();
    let (objective, options) = (&config.objective, &config.solver);
    let refined = solver::refine(
        &footage,
        &shared,
        target,
        &short.estimate,
        objective,
        options,
        &|_| true,
    )
    .unwrap();
    let solution =
        solver::complete(&footage, &shared, target, refined, objective, options, &|_| true).unwrap();
    let errors = errors(&sequence, &Surface::of(&prior, &solution), &solution.estimate);
    let after = Triple::from(&errors);
    println!(
        "{seed:4} | {:6.2} -> {:5.2} deg | {:6.2} -> {:5.2} % | depth {:.4} -> {:.4} | IoU {:.3}",
        before.orientation,
        after.orientation,
        before.location,
        after.location,
        before.depth,
        after.depth,
        errors.silhouette_iou_mean.unwrap(),
    );
    (before, after)
}

#[test]
fn a_perturbed_start_comes_back_to_the_truth() {
    let (before, after) = solved(0);
    assert!(!before.is_right() && after.is_right());
}

#[test]
#[ignore = "twenty full solves: a measurement, not a check"]
fn all_twenty_seeds() {
    let good = (0u64..20)
        .into_par_iter()
        .filter(|&seed| solved(seed).1.is_right())
        .count();
    println!("{good} of 20 within 1 degree, 4 % and a depth error of 0.01 at the best scale");
}
