//! libspba as a C++ stack has it: installed, moved, found by CMake and by pkg-config, and fed from memory.

mod frames;
mod package;
mod samples;

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror"];

/// What a command says; it must succeed.
fn succeed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{command:?}\n{told}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    told
}

/// The prefix: installed elsewhere and moved there, so that nothing in it may remember where it was.
fn prefix() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("library");
        fs::create_dir_all(&folder).unwrap();
        // nextest runs each test as a process of its own.
        let lock = File::create(folder.join("lock")).unwrap();
        lock.lock().unwrap();
        let (build, first, moved) = (folder.join("build"), folder.join("first"), folder.join("moved"));
        for old in [&first, &moved] {
            let _ = fs::remove_dir_all(old);
        }
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
        succeed(
            Command::new("cmake")
                .args([
                    "-S",
                    "cpp",
                    "-DCMAKE_BUILD_TYPE=Debug",
                    "-DCMAKE_INSTALL_LIBDIR=lib",
                    "-B",
                ])
                .arg(&build)
                .arg(format!("-DCMAKE_INSTALL_PREFIX={}", first.display()))
                .arg(format!("-DSPBA_CARGO_TARGET_DIR={}", target.display()))
                .current_dir(ROOT),
        );
        succeed(Command::new("cmake").arg("--build").arg(&build));
        succeed(Command::new("cmake").arg("--install").arg(&build).arg("--strip"));
        fs::rename(&first, &moved).unwrap();
        moved
    })
}

/// What pkg-config says of the moved library.
fn flags() -> Vec<String> {
    let told = succeed(
        Command::new("pkg-config")
            .args(["--cflags", "--libs", "spba"])
            .env("PKG_CONFIG_PATH", prefix().join("lib/pkgconfig")),
    );
    let run_path = format!("-Wl,-rpath,{}", prefix().join("lib").display());
    told.split_whitespace()
        .map(str::to_owned)
        .chain([run_path])
        .collect()
}

/// A program of one source file, made with a compiler, these arguments, and what pkg-config says.
fn compiled(compiler: &str, source: &Path, arguments: &[&str], libraries: &[&str]) -> PathBuf {
    let name = format!(
        "{}-{}",
        source.file_stem().unwrap().display(),
        arguments.concat().replace(['/', ',', '='], "")
    );
    let program = prefix().with_file_name(name);
    succeed(
        Command::new(compiler)
            .args(arguments)
            .args(WARNINGS)
            .arg(source)
            .args(flags())
            .args(libraries)
            .arg("-o")
            .arg(&program),
    );
    program
}

/// The samples, built by CMake from the moved prefix.
fn samples() -> &'static Path {
    static SAMPLES: OnceLock<PathBuf> = OnceLock::new();
    SAMPLES.get_or_init(|| {
        let build = prefix().with_file_name("samples");
        let flags = WARNINGS.join(" ");
        succeed(
            Command::new("cmake")
                .arg("-S")
                .arg(prefix().join("share/spba/samples"))
                .arg("-B")
                .arg(&build)
                .arg(format!("-DCMAKE_PREFIX_PATH={}", prefix().display()))
                .arg(format!("-DCMAKE_C_FLAGS={flags}"))
                .arg(format!("-DCMAKE_CXX_FLAGS={flags}"))
                .arg("-DCMAKE_BUILD_TYPE=Release"),
        );
        succeed(Command::new("cmake").arg("--build").arg(&build));
        build
    })
}
