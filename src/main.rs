//! The command line: one file per verb under `cli`.

mod cli;

fn main() -> std::process::ExitCode {
    // A reader that has seen enough (`… | head`) ends the program quietly; Rust's default is a panic.
    sigpipe::reset();
    cli::run()
}
