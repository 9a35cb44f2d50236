//! The command `elbowroom`: [`elbowroom_cli::run`].

use std::process::ExitCode;

/// The allocator of musl asks the operating system so often that runs would take a quarter longer.
#[cfg(target_env = "musl")]
#[global_allocator]
static ALLOCATOR: dlmalloc::GlobalDlmalloc = dlmalloc::GlobalDlmalloc;

fn main() -> ExitCode {
    elbowroom_cli::run(std::env::args_os().collect()).into()
}
