//! The programs in `examples/` run on the bundled sequence, and say what they should.

use std::path::Path;

#[allow(dead_code)]
#[path = "../../examples/evaluate.rs"]
mod evaluate;
#[allow(dead_code)]
#[path = "../../examples/objective.rs"]
mod objective;
#[allow(dead_code)]
#[path = "../../examples/solve.rs"]
mod solve;

#[test]
fn a_quick_solve_comes_near_the_truth() {
    let car = Path::new("data/sequences/car");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    solve::run(car, &out).unwrap();
    let errors = evaluate::run(&out, car).unwrap();
    assert_eq!(errors.frames.len(), 10);
    let orientation = errors.orientation_error_deg.unwrap();
    assert!(orientation.mean < 5.0, "{orientation:?}");
    let location = errors.location_error_percent.unwrap();
    assert!(location.mean < 15.0, "{location:?}");
}

#[test]
fn the_gradient_is_that_of_the_objective() {
    let [gradient, difference] = objective::run(Path::new("data/sequences/car")).unwrap();
    assert!(gradient.abs() > 1.0, "{gradient}");
    assert!(
        (gradient - difference).abs() < 0.01 * gradient.abs(),
        "{gradient} {difference}"
    );
}
