//! The command `elbowroom`: [`elbowroom_cli::run`].

use std::process::ExitCode;

fn main() -> ExitCode {
    elbowroom_cli::run(std::env::args_os().collect()).into()
}
