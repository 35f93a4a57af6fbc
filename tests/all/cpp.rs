//! The C++ by itself: compiled against Ceres and Eigen, the headers as a C++ stack sees them, and run under
//! sanitizers.

use std::fs::File;
use std::path::Path;
use std::process::Command;

/// AddressSanitizer, which finds leaks too, and UndefinedBehaviorSanitizer; numbers too large for an integer.
const MEMORY: &str = "address,undefined,float-cast-overflow";
const RACES: &str = "thread";

/// Of `cpp/tests/<name>.cc`; what is up to date is not compiled again.
fn compile_and_run(name: &str, sanitizers: &str) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(sanitizers);
    std::fs::create_dir_all(&folder).unwrap();
    let program = folder.join(name);
    // One make at a time: they share objects.
    let lock = File::create(folder.with_file_name("make.lock")).unwrap();
    lock.lock().unwrap();
    succeed(
        Command::new("make")
            .args(["-s", "-j2", "-f", "cpp/tests/Makefile"])
            .arg(format!("SANITIZE={sanitizers}"))
            .arg(format!("OUT={}", folder.display()))
            .arg(&program)
            .current_dir(env!("CARGO_MANIFEST_DIR")),
    );
    drop(lock);
    succeed(&mut Command::new(&program));
}

fn succeed(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{command:?}\n{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn every_functors_derivative_is_that_of_its_value() {
    compile_and_run("gradients", MEMORY);
}

#[test]
fn free_depth_blocks_have_the_sums_of_their_functor() {
    compile_and_run("free_depth", MEMORY);
}

#[test]
fn reprojection_blocks_have_the_derivatives_of_their_functor() {
    compile_and_run("bundle", MEMORY);
}

#[test]
fn soft_tails_keep_the_cost_and_its_gradient() {
    compile_and_run("tails", MEMORY);
}

#[test]
fn a_consumer_links_the_headers_alone() {
    compile_and_run("consumer", MEMORY);
}

#[test]
fn the_accumulated_evaluation_is_that_of_the_blocks() {
    compile_and_run("evaluation", MEMORY);
}

#[test]
fn threads_do_not_race_and_change_no_bytes() {
    compile_and_run("threads", RACES);
}
