//! Benchmark files next to the repository. Tests that need them print a note and pass if they are
//! missing.

use std::path::{Path, PathBuf};

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};

use crate::skipped::skipped;

/// Returns the folder of benchmark data, if it exists.
pub(crate) fn data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(format_args!("there is no {}", folder.display()));
    None
}

/// Reads the task of a domain and a problem file. The error holds the messages.
pub(crate) fn task(domain: &Path, problem: &Path) -> Result<Task, String> {
    let source = |path: &Path| {
        let read = std::fs::read(path);
        let bytes = read.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Source::from_bytes(path.display().to_string(), &bytes)
    };
    match read_problem(&source(domain), &source(problem)) {
        Ok((problem, _)) => Ok(Task::new(problem)),
        Err(diagnostics) => Err(diagnostics.render(false)),
    }
}

/// Parses a number.
pub(crate) fn number(text: &str) -> Rational {
    text.parse().expect("a correct test")
}
