//! `compare`, quick: minimisers of the user's own choice on a small sequence; what cannot be compared is refused by name.

use assert_cmd::Command;
use serde_json::Value;
use spba_ceres::study::MinimiserSettings;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

const MINIMISERS: &str = r#"
schema = 1
[perturbation]
rotation_deg = 4.0
share_of_distance = 0.01
[objective]
style_weight = 10.0
[[minimisers]]
name = "lm"
minimiser = { method = "lm" }
[[minimisers]]
name = "lm-blocks"
minimiser = { method = "lm", linear_solver = "dense_normal_cholesky" }
evaluation = "blocks"
[[minimisers]]
name = "lbfgs-5"
minimiser = { method = "lbfgs", rank = 5 }
strategy = "alternating"
"#;

struct Home {
    folder: tempfile::TempDir,
}

impl Home {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("minimisers.toml"), MINIMISERS).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn arguments(&self, input: &str, out: &str, cache: &str) -> Vec<String> {
        let path = |name: &str| self.path(name).to_str().unwrap().to_owned();
        let of_home = [
            "--minimisers".to_owned(),
            path("minimisers.toml"),
            "--out".to_owned(),
            path(out),
            "--cache".to_owned(),
            path(cache),
        ];
        let common = ["compare", input, "--frames", "0..4", "--seeds", "2", "--quick"];
        common.map(str::to_owned).into_iter().chain(of_home).collect()
    }

    fn compare(&self, input: &str, out: &str, cache: &str) -> String {
        let assert = Command::cargo_bin("spba-ceres")
            .unwrap()
            .current_dir(ROOT)
            .args(self.arguments(input, out, cache))
            .assert()
            .success();
        String::from_utf8(assert.get_output().stdout.clone()).unwrap()
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn records(&self, cache: &str) -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(self.path(cache).join("records")) else {
            return Vec::new();
        };
        let paths = entries.map(|entry| entry.unwrap().path());
        paths
            .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
            .collect()
    }
}

/// A CSV without its columns of processor seconds.
fn untimed(csv: &str) -> String {
    let mut lines = csv.lines();
    let headings: Vec<&str> = lines.next().unwrap().split(',').collect();
    let kept = headings.iter().take_while(|heading| !heading.starts_with("cpu_"));
    let kept = kept.count();
    assert!(
        kept < headings.len() && headings[kept..].iter().all(|heading| heading.starts_with("cpu_")),
        "{headings:?}"
    );
    csv.lines()
        .map(|line| line.split(',').take(kept).collect::<Vec<_>>().join(",") + "\n")
        .collect()
}

/// A record without processor seconds.
fn without_seconds(value: Value) -> Value {
    match value {
        Value::Object(fields) => fields
            .into_iter()
            .filter(|(key, _)| key != "cpu_seconds")
            .map(|(key, value)| (key, without_seconds(value)))
            .collect(),
        Value::Array(values) => values.into_iter().map(without_seconds).collect(),
        other => other,
    }
}

#[test]
fn own_minimisers_are_compared_from_the_same_starts_to_the_same_bytes() {
    let home = Home::new();
    let car = "data/sequences/car";
    let printed = home.compare(car, "a", "cache-a");
    for words in [
        "lm-blocks",
        "lbfgs-5",
        "Within 1 % of the best objective first: `",
    ] {
        assert!(printed.contains(words), "`{words}` is not in:\n{printed}");
    }
    let results = home.read("a/compare.csv");
    assert_eq!(results.lines().count(), 1 + 3 * 2, "{results}");
    assert!(
        results.contains(",rotation_error_deg,location_error_percent,depth_error,"),
        "{results}"
    );
    let table = home.read("a/compare.md");
    assert!(table.starts_with("| minimiser | objective | above the best, % |") && table.contains(" ± "));
    assert_eq!(home.read("a/compare.toml"), MINIMISERS);

    let record: Value = serde_json::from_str(&home.read("a/compare.json")).unwrap();
    let comparison = &record["comparison"];
    assert_eq!(comparison["starts"].as_array().unwrap().len(), 2);
    let starts_at = |index: usize| comparison["minimisations"][index]["states"][0]["objective"].as_f64();
    assert!(starts_at(0).is_some());
    assert_eq!((starts_at(0), starts_at(0)), (starts_at(1), starts_at(2)));
    assert_eq!((starts_at(3), starts_at(3)), (starts_at(4), starts_at(5)));
    assert_ne!(starts_at(0), starts_at(3), "the second start is another");
    for minimisation in comparison["minimisations"].as_array().unwrap() {
        let last = |of: &str| minimisation[of].as_array().unwrap().last().unwrap().clone();
        let (state, iteration) = (last("states"), last("iterations"));
        assert_eq!(state["iterations"], iteration["iterations"]);
        let seconds = |of: &Value| of["cpu_seconds"].as_f64().unwrap();
        assert!(0.0 < seconds(&iteration) && seconds(&iteration) <= seconds(&state) + 0.05);
    }
    for config in comparison["minimisers"].as_array().unwrap() {
        assert_eq!(config["config"]["objective"]["style_weight"], 10.0);
    }

    // From its records, processor seconds and all; then solved again.
    let records = home.records("cache-a").len();
    assert_eq!(home.compare(car, "a", "cache-a"), printed);
    assert_eq!(home.records("cache-a").len(), records);
    home.compare(car, "b", "cache-b");
    for name in ["compare.csv", "compare-calls.csv", "compare-iterations.csv"] {
        let [a, b] = ["a", "b"].map(|out| untimed(&home.read(&format!("{out}/{name}"))));
        assert_eq!(a, b, "{name}");
    }
    let again: Value = serde_json::from_str(&home.read("b/compare.json")).unwrap();
    assert_eq!(without_seconds(record), without_seconds(again));
    for axis in [
        "objective-iterations",
        "objective-evaluations",
        "objective-seconds",
        "location-seconds",
    ] {
        let svg = home.read(&format!("a/compare-{axis}.svg"));
        assert!(
            svg.contains("</svg>") && svg.contains("lbfgs-5") && !svg.contains("NaN"),
            "{axis}"
        );
    }

    // The same without truth, into the same folder.
    let sequence = spba_ceres::sequence::load(&Path::new(ROOT).join(car), &Default::default()).unwrap();
    let sequence = sequence.edited(|content| content.truth = None).unwrap();
    let plain = home.path("plain");
    spba_ceres::sequence::write(&sequence, &plain).unwrap();
    home.compare(plain.to_str().unwrap(), "a", "cache-a");
    for name in ["compare.md", "compare.csv", "compare-calls.csv"] {
        let text = home.read(&format!("a/{name}"));
        assert!(
            text.contains("lbfgs-5") && !text.contains("error"),
            "{name}: {text}"
        );
    }
    assert!(!home.path("a/compare-location-seconds.svg").exists());
}

#[test]
fn what_was_solved_before_an_interruption_is_kept() {
    let home = Home::new();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("spba-ceres"))
        .current_dir(ROOT)
        .args(home.arguments("data/sequences/car", "out", "cache"))
        .args(["--threads", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    // The start, and one of six minimisations.
    while home.records("cache").len() < 2 {
        assert!(began.elapsed() < Duration::from_secs(300), "no records");
        std::thread::sleep(Duration::from_millis(5));
    }
    let killed = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    let status = child.wait().unwrap();
    let message = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
    assert_eq!(status.code(), Some(1), "{message}");
    assert!(
        message.ends_with("error: interrupted; the same command goes on from here\n"),
        "{message}"
    );
    assert!(!home.path("out/compare.csv").exists());
    let kept = home.records("cache");
    assert!((2..7).contains(&kept.len()), "{kept:?}");
    let written = |path: &PathBuf| std::fs::metadata(path).unwrap().modified().unwrap();
    let before: Vec<_> = kept.iter().map(written).collect();
    home.compare("data/sequences/car", "out", "cache");
    assert_eq!(home.records("cache").len(), 7);
    assert_eq!(kept.iter().map(written).collect::<Vec<_>>(), before);
}

#[test]
fn what_cannot_be_compared_is_one_clear_error() {
    let home = Home::new();
    let refused = |input: &str, text: &str, words: &str| {
        std::fs::write(home.path("minimisers.toml"), text).unwrap();
        let assert = Command::cargo_bin("spba-ceres")
            .unwrap()
            .current_dir(ROOT)
            .args(home.arguments(input, "out", "cache"))
            .assert()
            .failure()
            .code(1);
        let message = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(message.contains(words), "`{words}` is not in: {message}");
        assert!(!home.path("out").exists(), "something was left behind");
    };
    let car = "data/sequences/car";
    refused(
        car,
        &MINIMISERS.replace("rank = 5", "history = 5"),
        "minimisers.toml: minimisers[2] `lbfgs-5`: minimiser: unknown field `history`",
    );
    refused(
        car,
        &MINIMISERS.replace("lbfgs-5", "lm"),
        "minimisers.toml: minimisers[2] `lm`: name: there is one of this name",
    );
    refused(
        car,
        "schema = 1\nminimisers = []\n",
        "minimisers.toml: minimisers: there is none; give at least one; `spba-ceres compare --print-config`",
    );
    refused("no/sequence", MINIMISERS, "no/sequence");
    refused(
        car,
        &MINIMISERS.replace("[objective]", "[init]\npoints = -1\n[objective]"),
        "minimisers.toml: init.points: ",
    );
    refused(
        car,
        &MINIMISERS.replace("schema = 1", "schema = 1\nprior = \"boat\""),
        "boat",
    );
    std::fs::remove_file(home.path("minimisers.toml")).unwrap();
    let assert = Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(home.arguments(car, "out", "cache"))
        .assert()
        .failure();
    let message = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(
        message.contains("minimisers.toml: cannot read the minimisers"),
        "{message}"
    );
}

#[test]
fn the_printed_configuration_and_the_documents_one_can_be_used() {
    let assert = Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(["compare", "--print-config"])
        .assert()
        .success();
    let printed = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    let names = |text: &str, name: &str| -> Vec<String> {
        let settings = MinimiserSettings::parse(text, Path::new(name)).unwrap();
        settings.methods.into_iter().map(|method| method.name).collect()
    };
    assert_eq!(
        names(&printed, "printed"),
        ["lm-joint", "lm-alternating", "lbfgs-joint", "lbfgs-alternating"]
    );
    let sweep = std::fs::read_to_string(Path::new(ROOT).join("results/sweep/minimisers.toml")).unwrap();
    assert_eq!(names(&sweep, "results/sweep/minimisers.toml").len(), 20);
    let document = std::fs::read_to_string(Path::new(ROOT).join("docs/experiments.md")).unwrap();
    let (_, section) = document
        .split_once("## Compare minimisers on your own sequence\n")
        .unwrap();
    let example = section
        .split("```toml\n")
        .nth(1)
        .unwrap()
        .split("```")
        .next()
        .unwrap();
    assert_eq!(
        names(example, "docs/experiments.md"),
        ["lm-joint", "lm-joint-blocks", "lbfgs-5-alternating"]
    );
    // Without an input there is nothing to compare.
    Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(["compare", "--seeds", "2"])
        .assert()
        .failure()
        .code(2);
}
