//! Turns of the cameras against a platform that turns evenly.

use super::rendered::{rendered, write_result};
use super::{eval, json};
use std::path::Path;

#[test]
fn a_result_and_its_input_against_a_platform() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name);
    let (surface, sequence, estimate) = rendered();
    spba_ceres::sequence::write(&sequence, &path("input")).unwrap();
    write_result(&surface, &sequence, estimate, &path("result"));
    // 0.1 rad a second.
    std::fs::write(
        path("turn.txt"),
        format!("full_turn_seconds {}\nsense 1\n", 20.0 * std::f64::consts::PI),
    )
    .unwrap();
    std::fs::write(path("times.txt"), "000.png 0\n001.png 1\n002.png 2\n003.png 3\n").unwrap();
    let mut command = eval(&[&path("result"), Path::new("--turn"), &path("turn.txt")]);
    command
        .arg("--times")
        .arg(path("times.txt"))
        .arg("--input")
        .arg(path("input"));
    let errors = json(&mut command);
    for column in ["result", "input"] {
        assert!(
            errors[column]["summary"]["max"].as_f64().unwrap() < 1e-6,
            "{errors}"
        );
        assert_eq!(errors[column]["frames"].as_array().unwrap().len(), 4);
    }
}

#[test]
fn the_poses_of_a_real_platform_are_as_good_as_they_were_measured_to_be() {
    let shared = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/natural/epfl_04");
    let shared = Path::new(shared);
    if !shared.exists() {
        println!("skipped: no ../shared/natural/epfl_04");
        return;
    }
    let mut command = eval(&[shared, Path::new("--turn"), &shared.join("turn.txt")]);
    let errors = json(command.arg("--times").arg(shared.join("times.txt")));
    // An independent fit of the same 16 poses gives 0.508° mean, 0.803° max.
    assert!(
        (errors["input"]["summary"]["mean"].as_f64().unwrap() - 0.508).abs() < 0.002,
        "{errors}"
    );
    assert!(
        (errors["input"]["summary"]["max"].as_f64().unwrap() - 0.803).abs() < 0.002,
        "{errors}"
    );
}
