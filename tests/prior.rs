//! A prior made elsewhere.

#![allow(clippy::unwrap_used)]

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
