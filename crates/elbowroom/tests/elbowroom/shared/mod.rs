//! Benchmark files next to the repository. Tests that need them print a note and pass if they are
//! missing.
#![allow(dead_code, unused_imports, reason = "each test uses some of it")]

pub(crate) mod case;
pub(crate) mod chains;
pub(crate) mod changed;
pub(crate) mod draw;
pub(crate) mod instances;
pub(crate) mod own;
pub(crate) mod rounds;

#[path = "../../../../../testing/sampled.rs"]
mod sampled;
#[path = "../../../../../testing/skipped.rs"]
mod skipped;

use std::path::{Path, PathBuf};

use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Source, read_plan, read_problem};
pub(crate) use sampled::one_in;
pub(crate) use skipped::skipped;

/// Returns the folder of benchmark data, if it exists.
pub(crate) fn data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(format_args!("there is no {}", folder.display()));
    None
}

/// Reads a file as source text.
pub(crate) fn source(path: &Path) -> Source {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    Source::from_bytes(path.display().to_string(), &bytes)
}

/// Reads a plan. Returns `None` if it is not one for this task.
pub(crate) fn plan(task: &Task, path: &Path) -> Option<TimeTriggeredPlan> {
    let read = read_plan(&source(path), task);
    read.ok().map(|(plan, _)| plan)
}

/// Reads the task of a domain and a problem file. The error holds the messages.
pub(crate) fn task(domain: &Path, problem: &Path) -> Result<Task, String> {
    match read_problem(&source(domain), &source(problem)) {
        Ok((problem, _)) => Ok(Task::new(problem)),
        Err(diagnostics) => Err(diagnostics.render(false)),
    }
}
