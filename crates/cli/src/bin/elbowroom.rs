//! The command `elbowroom`: [`elbowroom_cli::run`].

use std::process::ExitCode;

/// musl's own allocator calls the operating system so frequently that runs would take 25 % longer.
#[cfg(target_env = "musl")]
#[global_allocator]
static ALLOCATOR: dlmalloc::GlobalDlmalloc = dlmalloc::GlobalDlmalloc;

fn main() -> ExitCode {
    elbowroom_cli::run(std::env::args_os().collect()).into()
}
