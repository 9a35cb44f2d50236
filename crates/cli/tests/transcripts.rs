//! Runs the transcripts in `tests/cmd` and `docs/reference/calendars.md`, which document the command.
//!
//! A separate program, because it changes the current directory, which all tests of a program
//! share.

use std::path::Path;

#[test]
fn transcripts_match_the_command() {
    // File names in transcripts are relative to the root of the repository.
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::env::set_current_dir(root).expect("the repository");
    trycmd::TestCases::new()
        .default_bin_path(env!("CARGO_BIN_EXE_elbowroom"))
        .env("NO_COLOR", "1")
        .env("LC_ALL", "C")
        .case("crates/cli/tests/cmd/*.md")
        .case("docs/reference/calendars.md");
}
