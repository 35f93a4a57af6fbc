//! `report.html` of results of points and of surfaces: made anew by `report`, and used in headless Chromium as a person would.

use assert_cmd::Command;
use spba_ceres::prior::{self, LearnedPrior, PriorInfo};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const CHROMIUM: &str = "/usr/bin/chromium";

fn program() -> Command {
    Command::cargo_bin("spba-ceres").unwrap()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The points of a bundled prior of surfaces. No chair explains the car, so that its page is that of a result that is not usable.
fn points_of_chairs(home: &Path) -> PathBuf {
    let of_surfaces = prior::find("chair-legs").unwrap();
    let points = LearnedPrior::from(of_surfaces.output().clone());
    let path = home.join("chair.safetensors");
    prior::save(&path, &points, &PriorInfo::mirrored("chair", &points)).unwrap();
    path
}

/// A quick result of the bundled sequence by its relative path, from the repository.
fn solved(name: &str, prior: &Path, home: &Path) -> PathBuf {
    let out = home.join(name);
    let quick = "--hypotheses 1 --levels 1 --max-steps 3 --points 2048";
    program()
        .current_dir(root())
        .args(["solve", "data/sequences/car", "--prior"])
        .arg(prior)
        .arg("--out")
        .arg(&out)
        .args(quick.split(' '))
        .output()
        .unwrap();
    assert!(out.join("report.html").exists(), "a result without its page");
    out
}

/// Why pages cannot be opened here.
fn trouble() -> Option<&'static str> {
    if !Path::new(CHROMIUM).exists() {
        return Some("no /usr/bin/chromium (Debian: chromium)");
    }
    let imported = std::process::Command::new("python3")
        .args(["-c", "import playwright"])
        .output();
    match imported {
        Ok(output) if output.status.success() => None,
        _ => Some("python3 lacks playwright (pip install playwright)"),
    }
}

#[test]
fn pages_open_and_can_be_used() {
    let home = tempfile::tempdir().unwrap();
    let folders = [
        solved("chair", &points_of_chairs(home.path()), home.path()),
        solved("car", Path::new("car"), home.path()),
    ];
    for folder in &folders {
        let page = folder.join("report.html");
        let bytes = std::fs::read(&page).unwrap();
        assert!(bytes.len() < 8_000_000, "{} bytes", bytes.len());
        std::fs::remove_file(&page).unwrap();
        let began = Instant::now();
        program()
            .current_dir(root())
            .arg("report")
            .arg(folder)
            .assert()
            .success();
        // 0.4 s of one core; the rest is for busy machines.
        assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
        assert!(
            std::fs::read(&page).unwrap() == bytes,
            "made anew it is another page"
        );
    }
    if let Some(trouble) = trouble() {
        println!("skipped, the pages are not opened: {trouble}");
        return;
    }
    let status = std::process::Command::new("python3")
        .arg(root().join("tests/all/report_page.py"))
        .args([Path::new(CHROMIUM), home.path()])
        .args(folders.iter().map(|folder| folder.join("report.html")))
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn a_result_whose_sequence_is_gone_is_refused_by_name() {
    let home = tempfile::tempdir().unwrap();
    let out = solved("chair", &points_of_chairs(home.path()), home.path());
    let refused = |arguments: &[&str]| {
        let assert = program()
            .current_dir(home.path())
            .arg("report")
            .arg(&out)
            .args(arguments)
            .assert();
        String::from_utf8(assert.failure().code(1).get_output().stderr.clone()).unwrap()
    };
    let message = refused(&[]);
    assert!(
        message.contains("data/sequences/car, its input, is not there any more")
            && message.contains("--input"),
        "{message}"
    );
    let elsewhere = root().join("data/sequences/car");
    program()
        .current_dir(home.path())
        .arg("report")
        .arg(&out)
        .arg("--input")
        .arg(&elsewhere)
        .assert()
        .success();
    std::fs::remove_file(out.join("depth/003.exr")).unwrap();
    let message = refused(&["--input", elsewhere.to_str().unwrap()]);
    assert!(message.contains("depth/003.exr"), "{message}");
}
