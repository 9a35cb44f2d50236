//! How a test says that it has not tested: included by the tests of all crates.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::thread;

/// Says that the test that calls this is skipped, or stops short, for want of something.
///
/// One line, `skipped: TEST: WHY`, which `.ci/run` counts. It goes past what the test harness
/// captures, so that it is seen although the test passes.
pub(crate) fn skipped(why: impl Display) {
    let thread = thread::current();
    let test = thread.name().unwrap_or("a test");
    let _ = writeln!(io::stderr(), "skipped: {test}: {why}");
}
