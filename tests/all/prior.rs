//! A prior made elsewhere.

use spba_ceres::prior::{self, ShapePrior};
use std::path::Path;
use std::process::Command;

#[test]
fn the_python_example_writes_a_prior() {
    let installed = Command::new("python3")
        .args(["-c", "import numpy, safetensors"])
        .output();
    if !installed.is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 lacks numpy or safetensors (pip install numpy safetensors)");
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("boxes.safetensors");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/write_prior.py");
    let status = Command::new("python3").arg(script).arg(&path).status().unwrap();
    assert!(status.success());
    let (prior, info) = prior::open(path.to_str().unwrap()).unwrap();
    assert_eq!((info.category.as_str(), info.points), ("box", 2400));
    // Its modes stretch x, y and z by a tenth.
    let extent = |style: &[f64], axis: usize| {
        let shape = prior.shape(style);
        2.0 * shape.iter().map(|x| x[axis].abs()).fold(0.0, f64::max)
    };
    let size = [0, 1, 2].map(|axis| extent(&[0.0; 3], axis));
    assert!((size.iter().map(|s| s * s).sum::<f64>() - 1.0).abs() < 1e-5);
    for axis in 0..prior.style_len() {
        let mut style = [0.0; 3];
        style[axis] = 1.0;
        assert!((extent(&style, axis) / size[axis] - 1.1).abs() < 1e-3);
    }
}

fn refused(arguments: &[&str]) -> String {
    let run = assert_cmd::Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(arguments)
        .assert();
    let message = String::from_utf8(run.failure().code(1).get_output().stderr.clone()).unwrap();
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    message
}

#[test]
fn an_unfinished_trainings_state_is_not_overwritten() {
    let home = tempfile::tempdir().unwrap();
    let state = home.path().join("car.checkpoint");
    std::fs::write(&state, "kept").unwrap();
    let out = home.path().join("car.safetensors");
    let out = out.to_str().unwrap();
    let learn = [
        "prior",
        "learn",
        "--sources",
        "data/priors/car.toml",
        "--out",
        out,
    ];
    assert!(refused(&learn).contains("go on with --resume, or delete it"));
    if cfg!(feature = "training") {
        let train = [
            "regressor",
            "train",
            "--prior",
            "car",
            "--sources",
            "data/priors/car.toml",
            "--out",
            out,
        ];
        assert!(refused(&train).contains("go on with --resume, or delete it"));
    }
    assert_eq!(std::fs::read_to_string(state).unwrap(), "kept");
}

#[test]
fn what_is_no_regressor_is_refused() {
    let eval = |file: &str| refused(&["regressor", "eval", file, "--prior", "car"]);
    assert!(eval("nowhere.safetensors").contains("nowhere.safetensors: cannot read the regressor"));
    assert!(eval("data/priors/car.safetensors").contains("not a regressor"));
}

#[cfg(not(feature = "training"))]
#[test]
fn a_build_that_cannot_train_says_so() {
    let decoder = [
        "prior",
        "learn",
        "--kind",
        "decoder",
        "--sources",
        "x",
        "--out",
        "y",
    ];
    let train = [
        "regressor",
        "train",
        "--prior",
        "car",
        "--sources",
        "x",
        "--out",
        "y",
    ];
    for arguments in [&decoder[..], &train] {
        assert!(refused(arguments).contains("--features training"));
    }
}
