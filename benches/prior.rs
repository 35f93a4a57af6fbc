//! X(s) and ∂X/∂s of 24,576 points and 32 styles, linear and with a decoder's two hidden layers of 64.
#![allow(clippy::expect_used)]

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{DMatrix, DVector};
use spba_ceres::prior::{Layer, LearnedPrior, LinearPrior, ShapePrior};

const POINTS: usize = 24_576;
const STYLES: usize = 32;
const WIDTH: usize = 64;

fn number(i: usize) -> f64 {
    (i * 7919 % 1009) as f64 / 504.5 - 1.0
}

fn prior(hidden: Vec<Layer>) -> LearnedPrior {
    let features = STYLES + hidden.last().map_or(0, |layer| layer.bias.len());
    let mean = (0..3 * POINTS).map(number).collect();
    let basis = (0..3 * POINTS * features).map(|i| 0.01 * number(i)).collect();
    let output =
        LinearPrior::new(mean, basis, features, vec![[0.0, 1.0, 0.0]; POINTS]).expect("an output layer");
    LearnedPrior::new(STYLES, hidden, output).expect("a prior")
}

fn layer(inputs: usize) -> Layer {
    Layer {
        weight: DMatrix::from_fn(WIDTH, inputs, |r, c| number(r * inputs + c) / 8.0),
        bias: DVector::from_fn(WIDTH, |r, _| number(r)),
    }
}

fn bench(criterion: &mut Criterion) {
    let style: Vec<f64> = (0..STYLES).map(number).collect();
    let mut points = vec![0.0; 3 * POINTS];
    let mut jacobian = vec![0.0; 3 * POINTS * STYLES];
    for (name, prior) in [
        ("linear", prior(Vec::new())),
        ("decoder", prior(vec![layer(STYLES), layer(WIDTH)])),
    ] {
        criterion.bench_function(&format!("{name}: X and its derivative by s"), |bencher| {
            bencher.iter(|| {
                prior.points(&style, &mut points);
                prior.jacobian(&style, &mut jacobian);
            });
        });
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
