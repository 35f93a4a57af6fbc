//! How a joint LM iteration of all terms grows with points, frames and styles: `cargo bench --bench growth`.
//!
//! One thread; the bundled sequence's frames, over and over where more are asked for, and the car prior's modes likewise. An
//! iteration is the mean of Ceres's second to fifth. Each row is a process of its own, whose peak memory is told: with
//! the sequence and the whole prior, all pyramid levels.

use spba_ceres::init::{Estimate, InitOptions, initialise};
use spba_ceres::objective::{Block, Call, Footage, Objective, ObjectiveOptions};
use spba_ceres::prior::{self, LinearPrior, ShapePrior};
use spba_ceres::report::peak_memory_mb;
use spba_ceres::sequence::{self, LoadOptions};
use spba_ceres::solver::{Evaluation, SolverOptions};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

/// Points, frames, styles: around the defaults, one by one, and the largest.
const ROWS: [[usize; 3]; 13] = [
    [2048, 10, 32],
    [4096, 10, 32],
    [8192, 10, 32],
    [16_384, 10, 32],
    [24_576, 10, 32],
    [8192, 5, 32],
    [8192, 20, 32],
    [8192, 46, 32],
    [8192, 91, 32],
    [8192, 10, 16],
    [8192, 10, 64],
    [8192, 10, 128],
    [24_576, 91, 32],
];
const LEVELS: usize = 3;
/// The variable that makes a process measure one row.
const ROW: &str = "SPBA_GROWTH_ROW";

fn main() {
    if let Ok(row) = std::env::var(ROW) {
        let numbers: Vec<usize> = row.split(' ').map(|n| n.parse().expect("a number")).collect();
        println!("{}", measured(numbers[0], numbers[1], numbers[2]));
        return;
    }
    println!("points  frames  styles  LM iteration, ms  visibility, ms  peak memory, MB");
    for row in ROWS {
        let words = row.map(|n| n.to_string()).join(" ");
        let output = Command::new(std::env::current_exe().expect("this program"))
            .env(ROW, &words)
            .output()
            .expect("a process");
        assert!(
            output.status.success(),
            "{words}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        print!("{}", String::from_utf8_lossy(&output.stdout));
    }
}

fn measured(points: usize, frames: usize, styles: usize) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car");
    let sequence = sequence::load(&folder, &LoadOptions::default()).expect("the bundled sequence");
    let car = prior::find("car").expect("the bundled prior");
    let target = sequence.frames.len() / 2;
    let starts = initialise(
        &sequence,
        &car,
        &vec![0.0; car.style_len()],
        target,
        &InitOptions::default(),
    )
    .expect("a start");
    let found = &starts[0].estimate;
    let start = Estimate {
        camera_from_object: cycled(&found.camera_from_object, frames),
        style: vec![0.0; styles],
        ..found.clone()
    };
    let grown = sequence.edited(|content| {
        content.frames = cycled(&content.frames, frames);
        for (i, frame) in content.frames.iter_mut().enumerate() {
            frame.name = i.to_string();
        }
        content.truth = None;
    });
    let sequence = grown.expect("frames");
    let target = target.min(frames - 1);
    let prior = with_styles(&car, styles);
    drop(car);

    let footage = Footage::new(&sequence, LEVELS).expect("frames");
    let mut options = ObjectiveOptions::default();
    options.points = points;
    let mut objective = Objective::new(&footage, prior, &options, target, &start, 1).expect("an objective");
    let began = Instant::now();
    let visibility = objective.visibility(&start, 0).expect("a visibility");
    let visibility_s = began.elapsed().as_secs_f64();
    let call = Call {
        block: Block::All,
        free_alpha: true,
        minimiser: SolverOptions::default().minimiser,
        evaluation: Evaluation::Accumulated,
        max_iterations: 5,
        tolerance: 0.0,
    };
    let mut times = Vec::new();
    objective
        .minimise(&mut start.clone(), &visibility, &call, &mut |_| {
            times.push(Instant::now());
            true
        })
        .expect("steps");
    let iteration_s = (times[times.len() - 1] - times[1]).as_secs_f64() / (times.len() - 2) as f64;
    format!(
        "{points:6}  {frames:6}  {styles:6}  {:16.1}  {:14.1}  {:15.0}",
        1e3 * iteration_s,
        1e3 * visibility_s,
        peak_memory_mb().expect("Linux tells")
    )
}

fn cycled<T: Clone>(items: &[T], count: usize) -> Vec<T> {
    items.iter().cycle().take(count).cloned().collect()
}

/// The prior's modes, cut or over and over.
fn with_styles(prior: &prior::LearnedPrior, styles: usize) -> Arc<dyn ShapePrior> {
    let output = prior.output();
    let basis = output
        .basis()
        .chunks_exact(output.style_len())
        .flat_map(|row| cycled(row, styles))
        .collect();
    let prior = LinearPrior::new(output.mean().to_vec(), basis, styles, output.normals().to_vec());
    Arc::new(prior.expect("a prior"))
}
