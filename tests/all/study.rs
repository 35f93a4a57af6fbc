//! `reproduce` and `compare`, quick: every table and figure is made, from records that are kept.

use assert_cmd::Command;
use std::path::Path;

fn run(arguments: &[&str], home: &Path) -> String {
    let mut command = Command::cargo_bin("spba-ceres").unwrap();
    let cache = home.join("cache");
    let out = home.join("results");
    let output = command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(arguments)
        .args(["--quick", "--cache", cache.to_str().unwrap()])
        .args(["--out", out.to_str().unwrap()])
        .assert()
        .success();
    String::from_utf8(output.get_output().stdout.clone()).unwrap()
}

#[test]
fn every_table_and_figure_is_made_and_records_are_kept() {
    let home = tempfile::tempdir().unwrap();
    let results = home.path().join("results");
    let read = |name: &str| std::fs::read_to_string(results.join(name)).unwrap();

    // The bundled sequence stands in for one with openMVS's depth: what counts is that it gets a block of its own.
    let table1 = ["reproduce", "table1", "--openmvs-input", "data/sequences/car"];
    let printed = run(&table1, home.path());
    for row in [
        "ours",
        "as in the paper",
        "Zhu et al.",
        "off-the-shelf input",
        "initialisation (template)",
        "rendered (1)",
        "rendered, COLMAP + openMVS (1)",
    ] {
        assert!(printed.contains(row), "{row}:\n{printed}");
    }
    let details = read("table1.csv");
    assert_eq!(details.lines().count(), 1 + 7 * 2, "seven rows, two sequences");
    assert!(details.contains("depth_error_at_best_scale"));
    let again = run(&table1, home.path());
    // Processor seconds among them: nothing was solved again.
    assert_eq!((printed, details), (again, read("table1.csv")));

    let records = || {
        std::fs::read_dir(home.path().join("cache/records"))
            .unwrap()
            .count()
    };
    let before = records();
    run(&["reproduce", "fig6"], home.path());
    assert_eq!(records(), before, "Fig. 6 takes the records of Table 1");
    for what in ["fig3", "fig7", "fig8", "ablation"] {
        run(&["reproduce", what], home.path());
        let data: serde_json::Value = serde_json::from_str(&read(&format!("{what}.json"))).unwrap();
        assert_eq!(
            (&data["what"], &data["meaningful"]),
            (&what.into(), &false.into())
        );
        assert!(read(&format!("{what}.csv")).lines().count() > 1, "{what}");
    }
    run(
        &[
            "compare",
            "data/sequences/car",
            "--frames",
            "0..4",
            "--seeds",
            "1",
        ],
        home.path(),
    );
    for chart in [
        "fig3-surface",
        "fig3-slices",
        "fig6-histogram",
        "fig6-cumulative",
        "fig7",
        "fig8",
        "compare-objective-iterations",
        "compare-objective-seconds",
        "compare-objective-evaluations",
        "compare-location-seconds",
    ] {
        let svg = read(&format!("{chart}.svg"));
        assert!(svg.contains("</svg>") && !svg.contains("NaN"), "{chart}");
    }
}

#[test]
fn what_cannot_be_reproduced_is_one_clear_error() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name).to_str().unwrap().to_owned();
    let bundled = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/data/sequences/car"));
    std::fs::write(home.path().join("list.toml"), "frames = []\n").unwrap();
    let refused = |arguments: &[&str]| {
        let assert = Command::cargo_bin("spba-ceres")
            .unwrap()
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(["reproduce", "--cache", &path("cache"), "--out", &path("results")])
            .args(arguments)
            .assert()
            .failure()
            .code(1);
        let message = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert_eq!(message.lines().count(), 1, "{message}");
        message
    };
    assert!(refused(&["fig7", "--benchmark", &path("list.toml")]).contains("list.toml"));
    assert!(!home.path().join("results").exists(), "nothing half-written");
    assert!(refused(&["fig7", "--frames", "1"]).contains("--frames 1: no sequence"));
    let missing = path("missing");
    assert!(refused(&["table1", "--quick", "--natural", &missing]).contains("missing"));
    // A sequence without truth: what `import` makes without --truth.
    let sequence = spba_ceres::sequence::load(bundled, &Default::default()).unwrap();
    let sequence = sequence.edited(|content| content.truth = None).unwrap();
    let plain = home.path().join("plain");
    spba_ceres::sequence::write(&sequence, &plain).unwrap();
    for option in ["--real-input", "--openmvs-input"] {
        let message = refused(&["table1", "--quick", option, plain.to_str().unwrap()]);
        assert!(
            message.contains("no [truth]; make it with spba-ceres import --truth"),
            "{message}"
        );
    }
    assert!(refused(&["fig8", "--quick", "--natural", "x"]).contains("only table1 takes further sequences"));
}
