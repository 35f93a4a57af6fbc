//! `batch`: a list of sequences is solved, gone on with, and told in a table; lists that cannot be used are refused by name.

use assert_cmd::Command;
use std::path::Path;

const QUICK: &str =
    r#"["--hypotheses", "1", "--levels", "1", "--max-steps", "3", "--points", "1024", "--frames", "0..4"]"#;

struct Run {
    code: i32,
    out: String,
    error: String,
}

fn batch(list: &Path, out: &Path, arguments: &[&str]) -> Run {
    let assert = Command::cargo_bin("spba-ceres")
        .unwrap()
        .arg("batch")
        .arg(list)
        .arg("--out")
        .arg(out)
        .args(arguments)
        .assert();
    let output = assert.get_output();
    Run {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout.clone()).unwrap(),
        error: String::from_utf8(output.stderr.clone()).unwrap(),
    }
}

fn car() -> String {
    format!("{}/data/sequences/car", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn a_list_is_gone_on_with_and_ends_in_a_table() {
    let home = tempfile::tempdir().unwrap();
    let (list, out) = (home.path().join("list.toml"), home.path().join("out"));
    let car = car();
    let text = format!(
        "schema = 1\noptions = {QUICK}\n[[sequences]]\ninput = \"{car}\"\nname = \"first\"\n\
         [[sequences]]\ninput = \"later\"\n"
    );
    std::fs::write(&list, &text).unwrap();
    assert_eq!(batch(&list, &out, &["--names"]).out, "first\nlater\n");
    let began = batch(&list, &out, &["--summary"]);
    assert!(
        began.code == 1 && began.out.contains("not started"),
        "{}{}",
        began.out,
        began.error
    );

    let run = batch(&list, &out, &[]);
    assert_eq!(run.code, 1);
    assert!(
        run.error.contains("error: 1 of 2 without a usable result: later"),
        "{}",
        run.error
    );
    let lines: Vec<&str> = run.out.lines().collect();
    assert_eq!(lines.len(), 3, "{}", run.out);
    assert!(
        lines[1].starts_with("first  ") && lines[2].starts_with("later  failed"),
        "{}",
        run.out
    );
    let csv = std::fs::read_to_string(out.join("summary.csv")).unwrap();
    assert!(csv.lines().nth(2).unwrap().contains("later"), "{csv}");
    let log = std::fs::read_to_string(out.join("later.log")).unwrap();
    assert!(log.contains("error: "), "{log}");

    // The sequence is there now, beside the list; the first is not solved again.
    std::os::unix::fs::symlink(&car, home.path().join("later")).unwrap();
    let made = |name: &str| {
        let result = out.join(name).join("result.json");
        std::fs::metadata(result).unwrap().modified().unwrap()
    };
    let first = made("first");
    let again = batch(&list, &out, &["--only", "1"]);
    assert!(
        again.code == 0 && again.out.is_empty() && again.error.starts_with("1 of 1: later "),
        "{}{}",
        again.out,
        again.error
    );
    let later = made("later");
    assert_eq!(batch(&list, &out, &[]).code, 0);
    assert_eq!((made("first"), made("later")), (first, later));

    std::fs::write(&list, text.replace("0..4", "0..5")).unwrap();
    let other = batch(&list, &out, &[]);
    assert!(
        other.code == 1
            && other
                .error
                .contains("first: its result is of another input or other options"),
        "{}",
        other.error
    );
}

#[test]
fn lists_that_cannot_be_used_are_refused_by_name() {
    let home = tempfile::tempdir().unwrap();
    let (list, out) = (home.path().join("list.toml"), home.path().join("out"));
    let refused = |text: &str, arguments: &[&str], words: &[&str]| {
        std::fs::write(&list, text).unwrap();
        let run = batch(&list, &out, arguments);
        assert_eq!(
            (run.code, run.error.trim_end().lines().count()),
            (1, 1),
            "{}",
            run.error
        );
        for word in words {
            assert!(run.error.contains(word), "`{word}` is not in: {}", run.error);
        }
        assert!(!out.exists(), "something was left behind");
    };
    let one = "[[sequences]]\ninput = \"a\"\n";
    refused("schema = 1\n", &[], &["list.toml", "sequences"]);
    refused(
        "schema = 1\nsequences = []\n",
        &[],
        &["list.toml: sequences: there is none"],
    );
    refused(
        &format!("schema = 2\n{one}"),
        &[],
        &["list.toml: schema: 1 expected, found 2"],
    );
    refused(
        &format!("schema = 1\n{one}option = []\n"),
        &[],
        &["sequences[0]", "unknown field `option`"],
    );
    refused(
        &format!("schema = 1\n{one}{one}"),
        &[],
        &["sequences[1]: name: a second `a`"],
    );
    refused(
        &format!("schema = 1\noptions = [\"--out\", \"b\"]\n{one}"),
        &[],
        &["options: --out is batch's own"],
    );
    refused(
        &format!("schema = 1\n{one}name = \"../a\"\n"),
        &[],
        &["name: `../a` is no file name"],
    );
    refused(
        &format!("schema = 1\n{one}"),
        &["--only", "3"],
        &["--only 3: the list's last is 0"],
    );
}
