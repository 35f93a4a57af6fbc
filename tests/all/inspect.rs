//! What `inspect` prints.

use crate::fixture;

fn inspect(arguments: &[&str], folder: &std::path::Path) -> String {
    let output = assert_cmd::Command::cargo_bin("spba-ceres")
        .unwrap()
        .current_dir(folder)
        .arg("inspect")
        .args(arguments)
        .output()
        .unwrap();
    String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_workspace_with_openmvs_depth() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("car");
    fixture::workspace(&input);
    fixture::openmvs(&input.join("openmvs"), 7, -0.5);
    fixture::picture(&input.join("images/d.png"), 9, 9, |_, _| 0);
    insta::assert_snapshot!(inspect(&["car", "--depth", "car/openmvs"], folder.path()));
}

#[test]
fn a_workspace_with_three_faults() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("car");
    fixture::workspace(&input);
    std::fs::remove_file(input.join("images/a.png")).unwrap();
    fixture::picture(&input.join("masks/b.png.png"), 32, 24, |_, _| 0);
    fixture::picture(&input.join("masks/c.png.png"), 30, 24, |_, _| 255);
    insta::assert_snapshot!(inspect(&["car"], folder.path()));
}
