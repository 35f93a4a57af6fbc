//! What one evaluation of Eq. 9 costs: `cargo bench --bench objective`.
//!
//! The bundled sequence's 10 frames and 8192 points of the car prior, one thread; once with the photometric
//! term alone, once with all terms; accumulated, and with a residual block each. An LM iteration is one accepted step: a
//! Jacobian, a linear solve, and a residual evaluation of the step.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use spba_ceres::init::{Estimate, InitOptions, initialise};
use spba_ceres::objective::{Block, Call, Footage, Objective, ObjectiveOptions, Pairs};
use spba_ceres::prior::{self, ShapePrior};
use spba_ceres::sequence::{self, LoadOptions, Sequence};
use spba_ceres::solver::{Evaluation, SolverOptions};
use std::path::Path;
use std::sync::Arc;

/// The target frame of the paper's star: the middle one.
const TARGET: usize = 5;

fn setting() -> (Sequence, Arc<dyn ShapePrior>, Estimate) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car");
    let sequence = sequence::load(&folder, &LoadOptions::default()).expect("the bundled sequence");
    let prior: Arc<dyn ShapePrior> = Arc::new(prior::find("car").expect("the bundled prior"));
    let style = vec![0.0; prior.style_len()];
    let starts =
        initialise(&sequence, prior.as_ref(), &style, TARGET, &InitOptions::default()).expect("a start");
    (sequence, prior, starts[0].estimate.clone())
}

fn objective(criterion: &mut Criterion) {
    let (sequence, prior, start) = setting();
    let footage = Footage::new(&sequence, 1).expect("frames");
    let all = ObjectiveOptions::default();
    let mut star = all.clone();
    star.pairs = Pairs::Star;
    let mut photometric = star.clone();
    photometric.silhouette_weight = 0.0;
    photometric.inverse_depth_weight = 0.0;
    photometric.style_weight = 0.0;
    for (name, options) in [
        ("photometric, star", photometric),
        ("all terms, star", star),
        ("all terms", all),
    ] {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        let mut objective =
            Objective::new(&footage, prior.clone(), &options, TARGET, &start, 1).expect("an objective");
        let visibility = objective.visibility(&start, 0).expect("a visibility");
        let mut moved = start.clone();
        // A new point each time: nothing is evaluated twice at the same one.
        let mut next = || {
            moved.style[0] += 1e-6;
            moved.clone()
        };
        group.bench_function("residual evaluation", |bencher| {
            bencher.iter(|| objective.evaluate(&next(), &visibility).expect("a value"));
        });
        group.bench_function("Jacobian evaluation", |bencher| {
            bencher.iter(|| {
                objective
                    .differentiate(&next(), &visibility)
                    .expect("derivatives")
            });
        });
        group.bench_function("visibility", |bencher| {
            bencher.iter(|| objective.visibility(&next(), 0).expect("a visibility"));
        });
        for evaluation in [Evaluation::Accumulated, Evaluation::Blocks] {
            for iterations in [1, 5] {
                let call = Call {
                    block: Block::All,
                    free_alpha: true,
                    minimiser: SolverOptions::default().minimiser,
                    evaluation,
                    max_iterations: iterations,
                    tolerance: 0.0,
                };
                let id = BenchmarkId::new(format!("LM, {evaluation:?}"), iterations);
                group.bench_function(id, |bencher| {
                    bencher.iter(|| {
                        objective
                            .minimise(&mut next(), &visibility, &call, &mut |_| true)
                            .expect("a step")
                    });
                });
            }
        }
        group.finish();
    }
}

criterion_group!(benches, objective);
criterion_main!(benches);
