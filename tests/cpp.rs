//! The headers as a C++ stack sees them: compiled by themselves against Ceres and Eigen, and run.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

fn compile_and_run(source: &str) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("program");
    let eigen = Command::new("pkg-config")
        .args(["--cflags", "eigen3"])
        .output()
        .unwrap();
    let eigen = String::from_utf8(eigen.stdout).unwrap().replace("-I", "-isystem");
    let compiled = Command::new("c++")
        .args(["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror"])
        .arg("-I")
        .arg(root.join("cpp/include"))
        .args(eigen.split_whitespace())
        .arg(root.join("cpp/tests").join(source))
        .arg("-o")
        .arg(&program)
        .args(["-lceres", "-lglog"])
        .status()
        .unwrap();
    assert!(compiled.success(), "{source} does not compile");
    let run = Command::new(&program).output().unwrap();
    let text = String::from_utf8_lossy(&run.stdout).into_owned() + &String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{text}");
}

#[test]
fn every_functors_derivative_is_that_of_its_value() {
    compile_and_run("gradients.cc");
}

#[test]
fn soft_tails_keep_the_cost_and_its_gradient() {
    compile_and_run("tails.cc");
}

#[test]
fn a_consumer_links_the_headers_alone() {
    compile_and_run("consumer.cc");
}
