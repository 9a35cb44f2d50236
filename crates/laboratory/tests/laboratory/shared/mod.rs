//! Experiments of the repository, and benchmark files next to it. Tests that need the latter print a
//! note and pass if they are missing.

use std::path::{Path, PathBuf};

use elbowroom_laboratory::compare::{Experiment, TimedCounts, run};
use elbowroom_laboratory::results::Results;
use elbowroom_laboratory::trials::Part;
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

/// Returns the text of a file in `experiments`.
pub(crate) fn experiment_file(path: &str) -> Result<String, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments");
    std::fs::read_to_string(folder.join(path)).map_err(|error| error.to_string())
}

/// Reads the experiment of that name in `experiments`.
pub(crate) fn experiment(name: &str) -> Experiment {
    let text = experiment_file(&format!("{name}.toml")).expect("it is there");
    let read = Experiment::read(Source::new(name, text.as_str()), &experiment_file);
    read.expect("it is an experiment")
}

/// Runs all trials of an experiment.
pub(crate) fn results(experiment: &Experiment, jobs: usize, trials: u64) -> Results<TimedCounts> {
    run(experiment, Part::whole(trials, jobs), &|_| true).expect("it runs")
}
