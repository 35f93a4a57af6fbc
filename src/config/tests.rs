//! What files and settings make of the configuration.

use super::*;
use crate::objective::Pairs;

#[test]
fn the_written_configuration_reads_back() {
    let mut config = Config::default();
    config.solver.minimiser = crate::solver::Minimiser::lbfgs(7);
    config.input.frames = "0..16".into();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("config.toml");
    std::fs::write(&path, config.to_toml().unwrap()).unwrap();
    assert_eq!(Config::load(&path).unwrap(), config);
}

#[test]
fn unknown_keys_are_errors_on_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("config.toml");
    std::fs::write(&path, "[solver]\nsteps = 3\n").unwrap();
    let message = Config::load(&path).unwrap_err().to_string();
    assert!(
        message.contains("solver.steps") && message.contains("max_steps") && !message.contains('\n'),
        "{message}"
    );
}

fn settings(texts: &[&str]) -> Vec<Setting> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

fn set(texts: &[&str]) -> Config {
    Config::layered(None, &settings(texts)).unwrap()
}

fn over_file(file: &str, texts: &[&str]) -> Result<Config, ConfigError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.toml");
    std::fs::write(&path, file).unwrap();
    Config::layered(Some(&path), &settings(texts))
}

fn refusal(texts: &[&str]) -> String {
    let settings: Result<Vec<Setting>, _> = texts.iter().map(|text| text.parse()).collect();
    let outcome = settings.and_then(|settings| Config::layered(None, &settings));
    let message = outcome.unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn settings_reach_nested_keys_arrays_and_strings() {
    let config = set(&[
        "objective.style_weight=0",
        "init.hypotheses.grid.rolls_deg = [0.0, 5]",
        "objective.pairs.offsets=[1,2]",
        "prior=chair",
        "input.frames='0..16'",
        "start.style=out/a result",
    ]);
    assert_eq!(config.objective.style_weight, 0.0);
    assert_eq!(config.init.hypotheses.grid.rolls_deg, [0.0, 5.0]);
    assert_eq!(config.objective.pairs, Pairs::Offsets(vec![1, 2]));
    assert_eq!(config.prior, "chair");
    assert_eq!(config.input.frames, "0..16");
    assert_eq!(config.start.style, "out/a result");
    let rest = set(&["objective={ style_weight = 0 }"]);
    assert_eq!(rest.objective.points, Config::default().objective.points);
    assert_eq!(rest.objective.style_weight, 0.0);
}

#[test]
fn settings_override_the_file_and_the_later_one_counts() {
    let file = "[objective]\nstyle_weight = 1.0\npoints = 100\n[solver]\nlevels = 2\n";
    let config = over_file(file, &["objective.style_weight=2", "objective.style_weight=4"]).unwrap();
    assert_eq!(config.objective.style_weight, 4.0);
    assert_eq!((config.objective.points, config.solver.levels), (100, 2));
}

#[test]
fn alternatives_do_not_mix() {
    assert_eq!(set(&["objective.pairs=star"]).objective.pairs, Pairs::Star);
    let file = "[objective]\npairs = \"star\"\n[solver.minimiser]\nmethod = \"lbfgs\"\nrank = 5\n";
    let kept = over_file(file, &["solver.minimiser.interpolation=quadratic"]).unwrap();
    assert!(matches!(kept.solver.minimiser, Minimiser::Lbfgs { rank: 5, .. }));
    assert_eq!(kept.objective.pairs, Pairs::Star);
    let other = over_file(
        file,
        &["solver.minimiser.method=lm", "objective.pairs.offsets=[1]"],
    )
    .unwrap();
    assert_eq!(other.solver.minimiser, Minimiser::lm(LinearSolver::Auto));
    assert_eq!(other.objective.pairs, Pairs::Offsets(vec![1]));
    // The default method need not be named; the order does not count.
    let radius = set(&["solver.minimiser.initial_trust_region_radius=10"]);
    assert!(matches!(
        radius.solver.minimiser,
        Minimiser::Lm {
            initial_trust_region_radius: 10.0,
            ..
        }
    ));
    let rank = set(&["solver.minimiser.rank=5", "solver.minimiser.method=lbfgs"]);
    assert_eq!(rank.solver.minimiser, Minimiser::lbfgs(5));
    let message = refusal(&["solver.minimiser.rank=5"]);
    assert!(
        message.starts_with("--set solver.minimiser.rank=5: unknown field `rank`"),
        "{message}"
    );
    let message = refusal(&["objective.pairs.offset=[1]"]);
    assert!(
        message.contains("unknown variant `offset`") && message.contains("`star` or `offsets`"),
        "{message}"
    );
}

#[test]
fn settings_that_cannot_be_used_are_named_with_the_mend() {
    for (texts, words) in [
        (
            &["threads=9", "objective.styl_weight=3"][..],
            &["--set objective.styl_weight=3: ", "`style_weight`"][..],
        ),
        (
            &["objektive.points=9"],
            &["--set objektive.points=9: ", "`objective`"],
        ),
        (
            &["threads=9", "objective.style_weight=heavy"],
            &["--set objective.style_weight=heavy: ", "expected f64"],
        ),
        (
            &["solver.levels=-1"],
            &["--set solver.levels=-1: ", "expected usize"],
        ),
        (&["objective=3"], &["--set objective=3: ", "expected struct"]),
        (
            &["prior.name=car"],
            &["--set prior.name=car: ", "expected a string"],
        ),
        (
            &["init.hypotheses.grid.rolls_deg=[0, 'x']"],
            &["--set init.hypotheses.grid.rolls_deg=[0, 'x']: ", "expected f64"],
        ),
        (
            &["solver.minimiser.method=newton"],
            &["--set solver.minimiser.method=newton: ", "`lm` or `lbfgs`"],
        ),
        (&["solver.levels"], &["--set solver.levels: no `=`", "KEY=VALUE"]),
        (&["=3"], &["--set =3: ", "key is empty"]),
        (
            &["solver..levels=3"],
            &["--set solver..levels=3: ", "key is empty"],
        ),
        (&["solver.levels="], &["--set solver.levels=: no value"]),
        (
            &["objective.pairs.offsets=[1, 2"],
            &["--set objective.pairs.offsets=[1, 2: ", "no TOML"],
        ),
    ] {
        let message = refusal(texts);
        for word in words {
            assert!(message.contains(word), "no `{word}` in: {message}");
        }
        assert!(!message.contains("threads=9"), "{message}");
    }
}

/// The keys that `section` accepts, from what it says to one that it does not.
fn keys_of(section: &str) -> Vec<String> {
    let message = refusal(&[&format!("{section}no_such_key=0")]);
    let (known, _) = message.split_once("; ").unwrap();
    let (_, known) = known.split_once("expected ").unwrap();
    known.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_written_configuration_names_every_key() {
    let text = Config::default().to_toml().unwrap();
    let sections = [
        "",
        "input.",
        "start.",
        "init.",
        "init.hypotheses.",
        "init.hypotheses.grid.",
        "objective.",
        "solver.",
        "solver.minimiser.",
    ];
    for section in sections {
        let keys = keys_of(section);
        assert!(keys.len() > 1, "{section}");
        for key in keys {
            let (value, table) = (format!("{key} = "), format!("[{section}{key}]"));
            let named = |line: &str| {
                let line = line.trim_start_matches(['#', ' ']);
                line.starts_with(&value) || line.starts_with(&table)
            };
            assert!(text.lines().any(named), "no {section}{key} in:\n{text}");
        }
    }
    for key in ["# depth = ", "# target = ", "# motion_deviation = ", "rank = 20"] {
        assert!(text.contains(key), "{text}");
    }
}
