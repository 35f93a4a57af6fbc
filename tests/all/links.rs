//! What the documents say of files, headings, constants and their own length holds.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What a newcomer reads in five minutes, as `wc -w` counts.
const MAX_WORDS_IN_README: usize = 900;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Markdown file below `folder`, but in what is built, downloaded or hidden.
fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with('.') || ["target", "out", "node_modules"].contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            documents(&path, found);
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

/// The lines outside fenced code.
fn prose(text: &str) -> Vec<&str> {
    let mut fenced = false;
    text.lines()
        .filter(|line| {
            let fence = line.trim_start().starts_with("```");
            fenced ^= fence;
            !fence && !fenced
        })
        .collect()
}

/// Where the links and pictures of a text lead.
fn targets(text: &str) -> Vec<String> {
    let mut targets = Vec::new();
    for line in prose(text) {
        let without_code: String = line.split('`').step_by(2).collect();
        for part in without_code.split("](").skip(1) {
            targets.push(part.split([')', ' ']).next().unwrap().to_owned());
        }
    }
    targets
}

/// The anchors that GitHub gives the headings of a text.
fn anchors(text: &str) -> Vec<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let headings = prose(text).into_iter().filter(|line| line.starts_with('#'));
    headings
        .map(|line| {
            let slug: String = line
                .trim_start_matches('#')
                .trim()
                .to_lowercase()
                .chars()
                .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
                .map(|c| if c == ' ' { '-' } else { c })
                .collect();
            let before = seen.entry(slug.clone()).or_default();
            *before += 1;
            match *before {
                1 => slug,
                nth => format!("{slug}-{}", nth - 1),
            }
        })
        .collect()
}

/// What is wrong with the links of `text`, which stands in the file `document`.
fn dead_links(document: &Path, text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    for target in targets(text) {
        if target.contains("://") {
            continue;
        }
        let (path, anchor) = target.split_once('#').unwrap_or((&target, ""));
        let file = match path {
            "" => document.to_owned(),
            path => document.parent().unwrap().join(path),
        };
        let of = |why: &str| format!("{}: `{target}`: {why}", document.display());
        if !file.exists() {
            faults.push(of("no such file; correct the link"));
        } else if !anchor.is_empty() {
            let other = match path {
                "" => text.to_owned(),
                _ => fs::read_to_string(&file).unwrap_or_default(),
            };
            if !anchors(&other).iter().any(|known| known == anchor) {
                faults.push(of("no such heading there; correct the link"));
            }
        }
    }
    faults
}

/// The rows of a table of constants, `name` | file | `value` | …, that its source does not bear out.
fn stale_constants(document: &Path, text: &str) -> (usize, Vec<String>) {
    let (mut rows, mut faults) = (0, Vec::new());
    for line in prose(text) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, name, file, value, ..] = cells[..] else {
            continue;
        };
        let code = |cell: &str| Some(cell.strip_prefix('`')?.strip_suffix('`')?.to_owned());
        let (Some(name), Some(value), [path]) = (code(name), code(value), &targets(file)[..]) else {
            continue;
        };
        rows += 1;
        let source = fs::read_to_string(document.parent().unwrap().join(path)).unwrap_or_default();
        let is_it = |line: &str| {
            let declared = line.split(['=', ':', ' ', '{']).any(|word| word == name);
            let constant = line.contains("const ") || line.contains("constexpr ");
            let given = line
                .split_once('=')
                .is_some_and(|(_, given)| given.contains(&value));
            declared && constant && given
        };
        if !source.lines().any(is_it) {
            faults.push(format!(
                "{}: {path} has no constant {name} = {value}; correct the row",
                document.display()
            ));
        }
    }
    (rows, faults)
}

fn none(faults: &[String]) {
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn links_lead_somewhere() {
    let mut found = Vec::new();
    documents(root(), &mut found);
    let names: Vec<_> = found
        .iter()
        .map(|file| file.strip_prefix(root()).unwrap())
        .collect();
    for known in ["README.md", "docs/method.md", "data/README.md", "fuzz/README.md"] {
        assert!(names.contains(&Path::new(known)), "{known} was not looked at");
    }
    let texts = found.iter().map(|file| (file, fs::read_to_string(file).unwrap()));
    let faults: Vec<String> = texts.flat_map(|(file, text)| dead_links(file, &text)).collect();
    none(&faults);
}

#[test]
fn the_readme_is_short() {
    let words = fs::read_to_string(root().join("README.md"))
        .unwrap()
        .split_whitespace()
        .count();
    assert!(
        words <= MAX_WORDS_IN_README,
        "README.md has {words} words, more than {MAX_WORDS_IN_README}; move some to docs/"
    );
}

#[test]
fn constants_are_those_of_the_source() {
    let document = root().join("docs/method.md");
    let (rows, faults) = stale_constants(&document, &fs::read_to_string(&document).unwrap());
    assert!(
        rows > 100,
        "{}: {rows} rows of constants are too few to be all",
        document.display()
    );
    none(&faults);
}

#[test]
fn faults_are_found() {
    let document = root().join("docs/pictures.md");
    let text = "# A `b` C, d\n[1](method.md) [2](nowhere.md) [3](#a-b-c-d)\n## Twice\n## Twice\n[4](#twice-1) [5](#twice-2) `[6](code.md)`\n\
                ```\n[7](fenced.md)\n```\n[8](method.md#constants) [9](method.md#no-such) [10](https://example.org/x)";
    let faults = dead_links(&document, text);
    let named: Vec<&str> = faults
        .iter()
        .map(|fault| fault.split('`').nth(1).unwrap())
        .collect();
    assert_eq!(named, ["nowhere.md", "#twice-2", "method.md#no-such"]);

    let row = |name: &str, value: &str| format!("| `{name}` | [x](../src/solver/mod.rs) | `{value}` | | |");
    let source = fs::read_to_string(root().join("src/solver/mod.rs")).unwrap();
    let (_, rest) = source.split_once("const FREE_STEPS: usize = ").unwrap();
    let (value, _) = rest.split_once(';').unwrap();
    let text = [
        row("FREE_STEPS", value),
        row("FREE_STEPS", &format!("{value}0")),
        row("NO_STEPS", "2"),
    ]
    .join("\n");
    let (rows, faults) = stale_constants(&document, &text);
    assert_eq!((rows, faults.len()), (3, 2), "{faults:?}");
}
