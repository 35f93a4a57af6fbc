//! What one evaluation of Eq. 9 costs: `cargo bench`.
//!
//! The bundled sequence's 10 frames and 8192 points of the car prior, one thread; once with the photometric
//! term alone, once with all terms. An LM iteration is one accepted step: a Jacobian, a linear solve, and a
//! residual evaluation of the step.

use criterion::{Criterion, criterion_group, criterion_main};
use spba_ceres::init::{Estimate, InitOptions, initialise};
use spba_ceres::objective::{Block, Call, Objective, ObjectiveOptions};
use spba_ceres::prior::{self, ShapePrior};
use spba_ceres::sequence::{self, LoadOptions, Sequence};
use spba_ceres::solver::SolverOptions;
use std::path::Path;
use std::sync::Arc;

fn setting() -> (Sequence, Arc<dyn ShapePrior>, Estimate) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car");
    let sequence = sequence::load(&folder, &LoadOptions::default()).expect("the bundled sequence");
    let prior: Arc<dyn ShapePrior> = Arc::new(prior::find("car").expect("the bundled prior"));
    let style = vec![0.0; prior.style_len()];
    let starts = initialise(&sequence, prior.as_ref(), &style, &InitOptions::default()).expect("a start");
    (sequence, prior, starts[0].estimate.clone())
}

fn objective(criterion: &mut Criterion) {
    let (sequence, prior, start) = setting();
    let all = ObjectiveOptions::default();
    let mut photometric = all.clone();
    photometric.silhouette_weight = 0.0;
    photometric.inverse_depth_weight = 0.0;
    photometric.style_weight = 0.0;
    for (name, options) in [("photometric", photometric), ("all terms", all)] {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        let mut objective =
            Objective::new(&sequence, prior.clone(), &options, 1, &start).expect("an objective");
        let mut moved = start.clone();
        // A new point each time: nothing is evaluated twice at the same one.
        let mut next = || {
            moved.style[0] += 1e-6;
            moved.clone()
        };
        group.bench_function("residual evaluation", |bencher| {
            bencher.iter(|| {
                objective.set_estimate(&next()).expect("a move");
                objective.evaluate().expect("a value")
            });
        });
        group.bench_function("Jacobian evaluation", |bencher| {
            bencher.iter(|| {
                objective.set_estimate(&next()).expect("a move");
                objective.gradient().expect("a gradient")
            });
        });
        for iterations in [1, 5] {
            let call = Call {
                block: Block::All,
                free_alpha: true,
                minimiser: SolverOptions::default().minimiser,
                max_iterations: iterations,
                tolerance: 0.0,
            };
            group.bench_function(format!("LM, {iterations} iterations"), |bencher| {
                bencher.iter(|| {
                    objective.set_estimate(&next()).expect("a move");
                    objective.minimise(&call, &mut |_| true).expect("a step")
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, objective);
criterion_main!(benches);
