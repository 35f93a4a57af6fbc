//! Programs that are killed or run out of disk: the old result or the new one, never half, and nothing left but what the next run removes.
#![cfg(feature = "vision")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Of each of `prepare` and `solve`.
const KILLS: u64 = 50;
const SIGNALS: [&str; 3] = ["KILL", "TERM", "INT"];

/// Four pictures and their masks.
struct Home {
    folder: tempfile::TempDir,
}

impl Home {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car");
        for kind in ["images", "masks"] {
            std::fs::create_dir(folder.path().join(kind)).unwrap();
            for k in 0..4 {
                let name = format!("{kind}/{k:03}.png");
                std::fs::copy(bundled.join(&name), folder.path().join(&name)).unwrap();
            }
        }
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, verb: &str, out: &str) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("spba-ceres"));
        command
            .current_dir(self.folder.path())
            .args([
                verb,
                "images",
                "--masks",
                "masks",
                "--focal",
                "400",
                "--max-size",
                "160",
            ])
            .args(["--out", out])
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        if verb == "solve" {
            command.args(["--set", "init.hypotheses.count=1", "--threads", "1"]);
            let short = "solver={ levels = 1, max_steps = 2, iterations_per_call = 4, free_form = 'none' }";
            command.args(["--set", short, "--set", "objective.points=1024"]);
        }
        command
    }

    /// How long it takes undisturbed.
    fn run(&self, verb: &str, out: &str) -> Duration {
        let began = Instant::now();
        assert!(
            self.command(verb, out).status().unwrap().success(),
            "{verb} {out}"
        );
        began.elapsed()
    }

    fn run_and_kill(&self, verb: &str, out: &str, after: Duration, signal: &str) {
        let mut child = self.command(verb, out).spawn().unwrap();
        std::thread::sleep(after);
        // It may be done by then.
        let _ = Command::new("kill")
            .args([format!("-{signal}"), child.id().to_string()])
            .stderr(Stdio::null())
            .status()
            .unwrap();
        child.wait().unwrap();
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// Every file below a folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(
                contents(&path)
                    .into_iter()
                    .map(|(name, bytes)| (path.join(name), bytes)),
            );
        } else {
            let bytes = std::fs::read(&path).unwrap();
            found.insert(path, bytes);
        }
    }
    found
        .into_iter()
        .map(|(path, bytes)| (path.strip_prefix(folder).unwrap_or(&path).to_owned(), bytes))
        .collect()
}

/// Moments over the time that a run takes, the same in every run of the test.
fn moments(whole: Duration) -> impl Iterator<Item = Duration> {
    let mut state = 1u64;
    (0..KILLS).map(move |_| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        whole.mul_f64(0.7 * (state >> 11) as f64 / (1u64 << 53) as f64)
    })
}

#[test]
fn a_killed_prepare_leaves_all_or_nothing_and_goes_on_to_the_same_bytes() {
    let home = Home::new();
    let whole = home.run("prepare", "whole");
    let expected = contents(&home.path("whole"));
    std::fs::remove_dir_all(home.path("whole.cache")).unwrap();
    let mut complete = 0;
    for (kill, moment) in moments(whole).enumerate() {
        home.run_and_kill("prepare", "out", moment, SIGNALS[kill % SIGNALS.len()]);
        if home.path("out").exists() {
            assert!(contents(&home.path("out")) == expected, "kill {kill} left half");
            complete += 1;
            // From the start again.
            std::fs::remove_dir_all(home.path("out")).unwrap();
            std::fs::remove_dir_all(home.path("out.cache")).unwrap();
        }
    }
    home.run("prepare", "out");
    assert!(contents(&home.path("out")) == expected, "resumed bytes differ");
    assert_eq!(home.names(), ["images", "masks", "out", "out.cache", "whole"]);
    let left = contents(&home.path("out.cache"));
    assert!(
        left.keys().all(|name| name.extension().is_none()),
        "{:?}",
        left.keys()
    );
    println!("{KILLS} kills, of which {complete} came too late");
}

#[test]
fn a_killed_solve_leaves_all_or_nothing() {
    let home = Home::new();
    home.run("solve", "warm");
    let names = |folder: &str| -> Vec<PathBuf> { contents(&home.path(folder)).into_keys().collect() };
    let expected = names("warm");
    let whole = home.run("solve", "warm-2");
    let sequence = contents(&home.path("images.sequence"));
    let mut complete = 0;
    for (kill, moment) in moments(whole).enumerate() {
        home.run_and_kill("solve", "out", moment, SIGNALS[kill % SIGNALS.len()]);
        assert!(contents(&home.path("images.sequence")) == sequence, "kill {kill}");
        if home.path("out").exists() {
            assert_eq!(names("out"), expected, "kill {kill}");
            spba_ceres::report::RunResult::load(&home.path("out")).unwrap();
            complete += 1;
            std::fs::remove_dir_all(home.path("out")).unwrap();
        }
    }
    home.run("solve", "out");
    assert_eq!(
        home.names(),
        [
            "images",
            "images.sequence",
            "images.sequence.cache",
            "masks",
            "out",
            "warm",
            "warm-2"
        ]
    );
    println!("{KILLS} kills, of which {complete} came too late or stopped it with a result");
}

#[test]
fn a_sequence_is_replaced_at_one_stroke() {
    let home = Home::new();
    home.run("solve", "a");
    let old = contents(&home.path("images.sequence"));
    // Another picture makes it another sequence.
    std::fs::remove_file(home.path("images/003.png")).unwrap();
    let whole = home.run("solve", "b");
    let new = contents(&home.path("images.sequence"));
    assert!(old != new);
    let picture = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car/images/003.png");
    for (kill, moment) in moments(whole).enumerate().take(16) {
        let with_all = kill % 2 == 0;
        if with_all {
            std::fs::copy(&picture, home.path("images/003.png")).unwrap();
        } else {
            std::fs::remove_file(home.path("images/003.png")).unwrap();
        }
        home.run_and_kill("solve", "c", moment, "KILL");
        let found = contents(&home.path("images.sequence"));
        assert!(found == old || found == new, "kill {kill} left half");
        let _ = std::fs::remove_dir_all(home.path("c"));
    }
}

/// Needs the right to mount.
#[test]
fn a_cache_never_costs_the_result_its_room() {
    let home = Home::new();
    home.run("prepare", "whole");
    let expected = contents(&home.path("whole"));
    let sizes = |contents: &BTreeMap<PathBuf, Vec<u8>>| contents.values().map(Vec::len).sum::<usize>();
    let (result, cache) = (sizes(&expected), sizes(&contents(&home.path("whole.cache"))));
    let disk = home.path("disk");
    std::fs::create_dir(&disk).unwrap();
    // Room for the result and the folders about it, not for the cache as well; or for the cache, and then not for the result.
    for size in [result + 120_000, cache + 60_000] {
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(&disk)
            .stderr(Stdio::null())
            .status();
        if !mounted.is_ok_and(|status| status.success()) {
            println!("skipped: no right to mount");
            return;
        }
        let output = home
            .command("prepare", "disk/out")
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let found = home
            .path("disk/out")
            .exists()
            .then(|| contents(&home.path("disk/out")));
        let cache_left = home.path("disk/out.cache").exists();
        assert!(Command::new("umount").arg(&disk).status().unwrap().success());
        assert!(found.is_some_and(|found| found == expected), "{size}: {said}");
        assert!(!cache_left && said.contains("the cache is removed"), "{said}");
        assert!(!said.contains('\u{1b}'), "{said}");
    }
}
