//! Reports of skipped tests. The tests of all crates include this file.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::thread;

/// Reports that the calling test is skipped, or ends early, because a requirement is missing.
///
/// Prints one line, `skipped: TEST: WHY`, which `.ci/run` counts. The line bypasses the capture of
/// the test harness, so that it is visible even if the test passes.
pub(crate) fn skipped(why: impl Display) {
    let thread = thread::current();
    let test = thread.name().unwrap_or("a test");
    let _ = writeln!(io::stderr(), "skipped: {test}: {why}");
}
