//! `solve` on input, options and priors that cannot be used: one line that names what is wrong and how to mend it, exit
//! status 1, no output folder. And on input that can: the same bytes twice.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

fn car() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car")
}

fn solve(input: &Path, out: &Path, options: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("spba-ceres").unwrap();
    command
        .arg("solve")
        .arg(input)
        .arg("--out")
        .arg(out)
        .args(options)
        .assert()
}

fn refused(input: &Path, options: &[&str], words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let assert = solve(input, &out, options).failure().code(1);
    let message = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        0,
        "something was left behind"
    );
}

#[test]
fn options_that_do_not_go_together() {
    let rank = ["--solver", "lm", "--set", "solver.minimiser.rank=5"];
    refused(
        &car(),
        &rank,
        &[
            "--set solver.minimiser.rank=5, --solver: ",
            "unknown field `rank`",
            "linear_solver",
        ],
    );
    refused(
        &car(),
        &["--set", "objective.photometric_huber=0"],
        &["photometric_huber", "more than 0"],
    );
    refused(&car(), &["--set", "solver.levels=0"], &["levels", "1 to 8"]);
    refused(&car(), &["--target", "10"], &["target 10", "give 0 to 9"]);
    refused(&car(), &["--frames", "3..3"], &["3..3"]);
    refused(&car(), &["--frames", "0..1"], &["frame"]);
}

#[test]
fn priors_that_cannot_be_used() {
    refused(&car(), &["--prior", "boat"], &["boat", "car"]);
    refused(
        &car(),
        &["--prior", "car,airplane"],
        &["car and airplane", "one category"],
    );
    let folder = tempfile::tempdir().unwrap();
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/priors/car.safetensors");
    let bytes = std::fs::read(&bundled).unwrap();
    let path = folder.path().join("other.safetensors");
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    refused(
        &car(),
        &["--prior", path.to_str().unwrap()],
        &["other.safetensors"],
    );
    // The version, in the header's JSON inside JSON: same length, another number.
    let newer = replaced(&bytes, b"\\\"schema\\\":2", b"\\\"schema\\\":9");
    std::fs::write(&path, newer).unwrap();
    refused(
        &car(),
        &["--prior", path.to_str().unwrap()],
        &["other.safetensors", "schema", "9"],
    );
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes
        .windows(from.len())
        .position(|window| window == from)
        .unwrap();
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

#[test]
fn configuration_with_an_unknown_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.toml");
    std::fs::write(&path, "[objective]\nsilhouete_weight = 1.0\n").unwrap();
    refused(
        &car(),
        &["--config", path.to_str().unwrap()],
        &["run.toml", "objective.silhouete_weight", "`silhouette_weight`"],
    );
}

#[test]
fn settings_that_cannot_be_used() {
    for (setting, words) in [
        (
            "objective.silhouete_weight=1",
            ["--set objective.silhouete_weight=1: ", "`silhouette_weight`"],
        ),
        (
            "objective.points=many",
            ["--set objective.points=many: ", "expected usize"],
        ),
        (
            "objective.points",
            ["--set objective.points: no `=`", "KEY=VALUE"],
        ),
    ] {
        refused(&car(), &["--set", setting], &words);
    }
}

fn printed(options: &[&str]) -> String {
    let assert = Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(["solve", "--print-config"])
        .args(options)
        .assert()
        .success();
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

#[test]
fn the_printed_configuration_is_one_for_config() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.toml");
    let file = ["--config", path.to_str().unwrap()];
    for options in [
        &[][..],
        &["--solver", "lbfgs", "--target", "0", "--depth", "out/openmvs"],
        &[
            "--set",
            "objective.pairs=star",
            "--set",
            "objective.motion_deviation=0",
        ],
    ] {
        let text = printed(options);
        std::fs::write(&path, &text).unwrap();
        assert_eq!(printed(&file), text);
    }
}

#[test]
fn a_flag_overrides_a_setting_and_that_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.toml");
    std::fs::write(&path, "[input]\nevery = 2\ntarget = 2\nframes = \"0..2\"\n").unwrap();
    let text = printed(&[
        "--config",
        path.to_str().unwrap(),
        "--every",
        "4",
        "--set",
        "input.every=3",
        "--set",
        "input.target=3",
    ]);
    for line in ["every = 4", "target = 3", "frames = \"0..2\""] {
        assert!(text.lines().any(|found| found == line), "no `{line}` in:\n{text}");
    }
}

#[test]
fn an_output_folder_in_use_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine"), "kept").unwrap();
    solve(&car(), folder.path(), &[]).failure().code(1);
    assert_eq!(
        std::fs::read_to_string(folder.path().join("mine")).unwrap(),
        "kept"
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Two frames, few points, one step: quick, but through the whole house, with either minimiser.
const QUICK: [&str; 8] = [
    "--frames",
    "0..2",
    "--set",
    "objective.points=512",
    "--set",
    "init.hypotheses.count=2",
    "--set",
    "solver={ levels = 1, max_steps = 1, iterations_per_call = 3 }",
];

#[test]
fn the_same_input_gives_the_same_bytes_whatever_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    for (name, threads) in [("a", "1"), ("b", "2")] {
        let options = [&QUICK[..], &["--threads", threads]].concat();
        solve(&car(), &folder.path().join(name), &options).success();
    }
    for file in ["shape.ply", "cameras.txt", "colmap/images.txt", "overlay.png"] {
        let read = |name: &str| std::fs::read(folder.path().join(name).join(file)).unwrap();
        assert!(read("a") == read("b"), "{file} differs");
    }
}

#[test]
fn of_several_templates_the_lowest_objective_decides() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a", "b"].map(|name| folder.path().join(name));
    let prior_of = |out: &Path| {
        let result = std::fs::read_to_string(out.join("result.json")).unwrap();
        let result: serde_json::Value = serde_json::from_str(&result).unwrap();
        result["prior"].as_str().unwrap().to_owned()
    };
    // Chairs may not explain a car, which is an error after the result is written.
    let said = |out: &Path, options: &[&str]| {
        let assert = solve(
            &car(),
            out,
            &[&QUICK[..], &["--prior", "chair"], options].concat(),
        );
        String::from_utf8(assert.get_output().stdout.clone()).unwrap()
    };
    let words = said(&first, &[]);
    let line = words.lines().find(|line| line.starts_with("template ")).unwrap();
    let objectives: Vec<(f64, &str)> = line["template ".len()..line.find(';').unwrap()]
        .split(',')
        .map(|of| of.trim().split_once(' ').unwrap())
        .map(|(name, objective)| (objective.parse().unwrap(), name))
        .collect();
    assert_eq!(objectives.len(), 3, "{line}");
    let best = objectives.iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap().1;
    assert!(prior_of(&first).starts_with(best), "{} {line}", prior_of(&first));
    // A style is one of its own prior alone.
    let words = said(&second, &["--init-style", first.to_str().unwrap()]);
    assert!(!words.contains("template "), "{words}");
    assert_eq!(prior_of(&second), prior_of(&first));
}

#[test]
fn the_papers_configuration_runs() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/paper.toml");
    let mut options = [&QUICK[..], &["--config", paper.to_str().unwrap()]].concat();
    // From two frames the short solve already ends where L-BFGS finds nothing to gain.
    options[1] = "0..3";
    solve(&car(), &out, &options).success();
    let config = std::fs::read_to_string(out.join("config.toml")).unwrap();
    assert!(
        config.contains("method = \"lbfgs\"") && config.contains("strategy = \"alternating\""),
        "{config}"
    );
    // Within one step; visibility is renewed between steps, and with it what the objective sums.
    let trace = std::fs::read_to_string(out.join("trace.csv")).unwrap();
    let totals: Vec<f64> = trace
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|cells| cells[..2] == ["level-0", "0"])
        .map(|cells| cells[4].parse().unwrap())
        .collect();
    assert!(totals.len() > 1 && totals.last() < totals.first(), "{totals:?}");
}

/// Where an earlier result ended; a trained network's file is for a prior of its own.
#[test]
fn a_solve_starts_where_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second, third] = ["first", "second", "third"].map(|name| folder.path().join(name));
    solve(&car(), &first, &QUICK).success();
    let path = first.to_str().unwrap();
    let result = |out: &Path| -> serde_json::Value {
        let text = std::fs::read_to_string(out.join("result.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let starts = |out: &Path| -> Vec<f64> {
        let hypotheses = result(out)["hypotheses"].as_array().unwrap().clone();
        let start = |hypothesis: &serde_json::Value| hypothesis["objective_start"].as_f64().unwrap();
        hypotheses.iter().map(start).collect()
    };
    solve(
        &car(),
        &second,
        &[&QUICK[..], &["--init-style", path, "--init-pose", path]].concat(),
    )
    .success();
    solve(&car(), &third, &[&QUICK[..], &["--init-style", path]].concat()).success();
    // The poses found are a better start than those of the templates, which the second has none of.
    let (of_result, of_templates) = (starts(&second), starts(&third));
    assert_eq!(of_result.len(), 1);
    assert!(
        of_templates.iter().all(|start| of_result[0] < 0.8 * start),
        "{of_result:?} {of_templates:?}"
    );

    let pose_of_two = ["--frames", "0..3", "--init-pose", path];
    refused(
        &car(),
        &pose_of_two,
        &["--init-pose", "no frame `", "all frames in use"],
    );
    refused(
        &car(),
        &["--prior", "chair", "--init-style", path],
        &["--init-style", "car surface", "chair-legs surface"],
    );
    refused(
        &car(),
        &["--init-style", "nowhere"],
        &["--init-style", "nowhere/result.json"],
    );
    let prior = concat!(env!("CARGO_MANIFEST_DIR"), "/data/priors/car.safetensors");
    refused(
        &car(),
        &["--prior", "chair", "--init-style", "regressor"],
        &["no regressor for `chair`", "train one"],
    );
    refused(
        &car(),
        &["--init-style", prior],
        &["car.safetensors", "not a regressor"],
    );
}

#[test]
fn the_bundled_regressor_is_its_file_and_no_mean_style() {
    let folder = tempfile::tempdir().unwrap();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/data/regressors/car.safetensors");
    let shape = |from: &str, name: &str| {
        let out = folder.path().join(name);
        solve(&car(), &out, &[&QUICK[..], &["--init-style", from]].concat()).success();
        std::fs::read(out.join("shape.ply")).unwrap()
    };
    let bundled = shape("regressor", "a");
    assert!(bundled == shape(file, "b"));
    assert!(bundled != shape("mean", "c"));
}

#[test]
fn what_only_raw_pictures_need_is_refused_for_a_sequence() {
    refused(&car(), &["--focal", "500"], &["--focal", "video", "leave it out"]);
    refused(&car(), &["--max-frames", "5"], &["--max-frames"]);
}
