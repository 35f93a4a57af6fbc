//! What is installed: its size, what it exports and links, its headers, functors and manual.

use super::{ROOT, WARNINGS, compiled, flags, prefix, samples, succeed};
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn only_functions_of_the_header_are_exported() {
    let library = prefix().join("lib/libspba.so.0");
    let header = fs::read_to_string(prefix().join("include/spba/spba.h")).unwrap();
    let told = succeed(Command::new("nm").args(["-D", "--defined-only"]).arg(&library));
    let exported: Vec<&str> = told.lines().filter_map(|line| line.split(' ').nth(2)).collect();
    assert!(exported.len() > 20, "{told}");
    for name in &exported {
        assert!(
            header.contains(&format!("{name}(")),
            "{name} is exported, and not in spba.h"
        );
    }
    let declared = header.lines().filter(|line| line.starts_with("SPBA_API "));
    assert_eq!(exported.len(), declared.count());
}

#[test]
fn the_library_is_small_and_links_neither_opencv_nor_the_command_line() {
    let library = prefix().join("lib/libspba.so.0");
    let megabytes = fs::metadata(&library).unwrap().len() as f64 / 1e6;
    assert!(megabytes <= 12.0, "{megabytes} MB");
    let needed = succeed(Command::new("readelf").args(["-d"]).arg(&library));
    assert!(needed.contains("Library soname: [libspba.so.0]"), "{needed}");
    assert!(
        needed.contains("libceres") && !needed.contains("opencv"),
        "{needed}"
    );
    let tree = succeed(
        Command::new(env!("CARGO"))
            .args([
                "tree",
                "--locked",
                "--offline",
                "-p",
                "spba-capi",
                "--edges",
                "normal",
                "--prefix",
                "none",
            ])
            .current_dir(ROOT),
    );
    for unwanted in [
        "clap ",
        "plotters ",
        "include_dir ",
        "rten ",
        "burn ",
        "indicatif ",
    ] {
        assert!(!tree.contains(unwanted), "{unwanted}: {tree}");
    }
}

/// When configuring, both this library and who uses its functors.
#[test]
fn another_ceres_is_refused() {
    let fake = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(fake.path().join(name), text).unwrap();
    write("CeresConfig.cmake", "");
    write(
        "CeresConfigVersion.cmake",
        "set(PACKAGE_VERSION 2.3.0)\nset(PACKAGE_VERSION_COMPATIBLE TRUE)\n",
    );
    for source in [Path::new(ROOT).join("cpp"), prefix().join("share/spba/samples")] {
        let output = Command::new("cmake")
            .arg("-S")
            .arg(&source)
            .arg("-B")
            .arg(fake.path().join("build"))
            .arg(format!("-DCeres_DIR={}", fake.path().display()))
            .arg(format!("-DCMAKE_PREFIX_PATH={}", prefix().display()))
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{}", source.display());
        assert!(told.contains("2.3.0 found"), "{told}");
        fs::remove_dir_all(fake.path().join("build")).unwrap();
    }
}

#[test]
fn priors_are_installed_as_files_with_their_licences() {
    let folder = prefix().join("share/spba/priors");
    for name in [
        "car.safetensors",
        "chair-legs.safetensors",
        "chair-armchair.safetensors",
        "chair-foot.safetensors",
        "airplane.safetensors",
        "LICENCES.md",
    ] {
        assert!(folder.join(name).exists(), "{name}");
    }
}

#[test]
fn a_program_in_c_passes() {
    let source = prefix().join("share/spba/samples/plain_c.c");
    let program = compiled("cc", &source, &["-std=c11", "-O1"], &["-lm"]);
    let told = succeed(&mut Command::new(program));
    assert!(told.contains("with observer calls"), "{told}");
    succeed(&mut Command::new(samples().join("plain_c")));
}

#[test]
fn hosts_mistakes_are_errors_and_their_glog_stays_theirs() {
    let source = Path::new(ROOT).join("cpp/tests/installed/library.cc");
    for arguments in [
        // An Eigen or Ceres with other instructions than the library's must not matter.
        &["-std=c++17", "-O2", "-march=native"][..],
        &[
            "-std=c++20",
            "-O1",
            "-g1",
            "-fsanitize=address,undefined",
            "-fno-sanitize-recover=all",
        ],
    ] {
        succeed(&mut Command::new(compiled(
            "c++",
            &source,
            arguments,
            &["-lglog", "-pthread"],
        )));
    }
}

#[test]
fn functors_of_all_layouts_agree_and_have_the_derivatives_of_their_values() {
    let source = Path::new(ROOT).join("cpp/tests/installed/functors.cc");
    let arguments = ["-std=c++17", "-O1", "-isystem", "/usr/include/eigen3"];
    succeed(&mut Command::new(compiled(
        "c++",
        &source,
        &arguments,
        &["-lceres", "-lglog"],
    )));
}

/// Every snippet of docs/cpp.md, in its order, as one file a language.
#[test]
fn the_snippets_of_the_manual_compile() {
    let manual = fs::read_to_string(Path::new(ROOT).join("docs/cpp.md")).unwrap();
    for (language, compiler, ending, arguments) in [
        (
            "cpp",
            "c++",
            "cc",
            ["-std=c++17", "-isystem", "/usr/include/eigen3"],
        ),
        ("c", "cc", "c", ["-std=c11", "-O1", "-fPIC"]),
    ] {
        let opening = format!("```{language}\n");
        let snippets = manual.split(opening.as_str()).skip(1);
        let snippets: Vec<&str> = snippets.map(|rest| rest.split("```").next().unwrap()).collect();
        assert!(!snippets.is_empty(), "{language}");
        let source = prefix().with_file_name(format!("manual.{ending}"));
        let headers = match language {
            "cpp" => "#include <cstdio>\n",
            _ => "",
        };
        fs::write(&source, headers.to_owned() + &snippets.concat()).unwrap();
        succeed(
            Command::new(compiler)
                .args(arguments)
                .args(WARNINGS)
                .arg("-c")
                .arg(&source)
                .args(flags().iter().filter(|flag| flag.starts_with("-I")))
                .args(["-o", "/dev/null"]),
        );
    }
}
