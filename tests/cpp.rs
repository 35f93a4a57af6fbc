//! The C++ by itself: compiled against Ceres and Eigen, the headers as a C++ stack sees them, and run.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

/// `core` names the files of `cpp/core` that `source` needs.
fn compile_and_run(source: &str, core: &[&str]) {
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
        .arg("-I")
        .arg(root.join("cpp"))
        .args(eigen.split_whitespace())
        .arg(root.join("cpp/tests").join(source))
        .args(core.iter().map(|name| root.join("cpp/core").join(name)))
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
    compile_and_run("gradients.cc", &[]);
}

#[test]
fn free_depth_blocks_have_the_sums_of_their_functor() {
    compile_and_run("free_depth.cc", &["free_depth.cc", "geometry.cc"]);
}

#[test]
fn soft_tails_keep_the_cost_and_its_gradient() {
    compile_and_run("tails.cc", &[]);
}

#[test]
fn a_consumer_links_the_headers_alone() {
    compile_and_run("consumer.cc", &[]);
}
