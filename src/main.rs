//! The command line: one file per verb under `cli`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
