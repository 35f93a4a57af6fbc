//! `render --benchmark` makes the folders that are missing, and only those.

use assert_cmd::Command;
use std::path::Path;

/// A list of two sequences of a cuboid, 40 × 30 pixels, with 2 or 3 frames each.
fn list(folder: &Path) -> std::path::PathBuf {
    let mut cuboid = String::new();
    for i in 0..8 {
        cuboid += &format!("v {} {} {}\n", i & 1, (i >> 1) & 1, 2 * (i >> 2));
    }
    cuboid += "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n";
    let models = folder.join("models");
    std::fs::create_dir(&models).unwrap();
    std::fs::write(models.join("box.obj"), cuboid).unwrap();
    let file = folder.join("list.toml");
    let text = format!(
        "frames = [2, 3]\n\
         [scene]\n\
         truth_points = 100\n\
         model = {{ kind = 'plain', path = '{}', up = '+y', front = '-z', licence = 'CC0-1.0' }}\n\
         camera = {{ width_px = 40, height_px = 30, focal_px = 45.0, principal_px = [20.0, 15.0] }}\n\
         arc = {{ distance = 1.7, elevation_deg = 15.0 }}\n\
         [[sequence]]\n\
         name = 'front'\n\
         scene = {{ seed = 1, arc.azimuth_deg = [20.0, 50.0] }}\n\
         [[sequence]]\n\
         name = 'rear'\n\
         scene = {{ seed = 2, arc.azimuth_deg = [120.0, 150.0] }}\n",
        models.display()
    );
    std::fs::write(&file, text).unwrap();
    file
}

/// The folders that a run's lines name as made, and those that were there.
fn render(list: &Path, out: &Path, more: &[&str]) -> (Vec<String>, Vec<String>) {
    let output = Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(["render", "--benchmark"])
        .arg(list)
        .arg("--out")
        .arg(out)
        .args(more)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let name = |line: &str| {
        let (folder, _) = line.split_once(": ").unwrap();
        Path::new(folder)
            .file_name()
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned()
    };
    let lines = String::from_utf8(output.stdout).unwrap();
    let (there, made): (Vec<&str>, Vec<&str>) =
        lines.lines().partition(|line| line.ends_with("already there"));
    (
        made.into_iter().map(name).collect(),
        there.into_iter().map(name).collect(),
    )
}

#[test]
fn a_benchmark_is_made_once() {
    let folder = tempfile::tempdir().unwrap();
    let (list, out) = (list(folder.path()), folder.path().join("out"));
    let none: Vec<String> = Vec::new();
    let (made, there) = render(&list, &out, &["--frames", "2"]);
    assert_eq!(
        (made, &there),
        (vec!["front-2".to_owned(), "rear-2".to_owned()], &none)
    );
    let first = std::fs::read(out.join("front-2/images/000.png")).unwrap();
    std::fs::remove_dir_all(out.join("rear-2")).unwrap();
    let (made, there) = render(&list, &out, &[]);
    assert_eq!(made, ["rear-2", "front-3", "rear-3"]);
    assert_eq!(there, ["front-2"]);
    assert_eq!(std::fs::read(out.join("front-2/images/000.png")).unwrap(), first);
    let sequence = spba_ceres::sequence::load(&out.join("rear-3"), &Default::default()).unwrap();
    assert_eq!(sequence.frames.len(), 3);
}
