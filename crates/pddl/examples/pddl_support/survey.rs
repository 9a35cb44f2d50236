//! Reads all problems and plans of the benchmark set, grounds the problems, and summarizes the
//! results.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use elbowroom_model::Task;
use elbowroom_model::reachability::{self, Answer, ground};
use elbowroom_pddl::{Diagnostic, Diagnostics, Feature, Source, read_plan, read_problem};

/// Results over the whole benchmark set.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    /// Results by collection and domain, in the order of the manifest.
    pub(crate) domains: Vec<Domain>,
    /// Number of plans of problems that were read, and number of those plans that were read.
    pub(crate) plans: (usize, usize),
}

/// Results for the instances of one domain.
#[derive(Debug, Default)]
pub(crate) struct Domain {
    /// `collection/domain`
    pub(crate) name: String,
    /// Number of problems.
    pub(crate) instances: usize,
    /// Number of problems that were read.
    pub(crate) read: usize,
    /// Number of read problems that were grounded within the limits.
    pub(crate) grounded: usize,
    /// Total number of reachable ground actions in them.
    pub(crate) actions: usize,
    /// Names of the refused problems, with all errors.
    pub(crate) refused: Vec<(String, Vec<Diagnostic>)>,
    /// Number of warnings by kind.
    pub(crate) warnings: BTreeMap<String, usize>,
}

/// Returns the reason why a problem was refused: the names of the unsupported features, or
/// `mistakes`.
pub(crate) fn reason(errors: &[Diagnostic]) -> String {
    if errors.iter().any(|error| Feature::of(error).is_none()) {
        return "mistakes".to_owned();
    }
    let features: BTreeSet<_> = errors.iter().filter_map(Feature::of).collect();
    let names: Vec<_> = features.iter().map(|feature| feature.name()).collect();
    names.join(", ")
}

/// Returns the folder of the benchmark set: below `ELBOWROOM_SHARED`, or next to the repository.
pub(crate) fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("ELBOWROOM_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    Some(shared.join("data/pddl")).filter(|folder| folder.is_dir())
}

/// Reads the whole benchmark set. Panics if a file of the manifest is missing.
pub(crate) fn survey(folder: &Path) -> Survey {
    let mut survey = Survey::default();
    for row in rows(&folder.join("manifest.csv")) {
        let name = format!("{}/{}", row[0], row[1]);
        if survey.domains.last().is_none_or(|last| last.name != name) {
            survey.domains.push(Domain {
                name,
                ..Domain::default()
            });
        }
        let domain = survey.domains.last_mut().expect("just pushed");
        domain.instances += 1;
        let read = read_problem(&source(folder, &row[3]), &source(folder, &row[4]));
        let diagnostics = match read {
            Ok((problem, warnings)) => {
                domain.read += 1;
                let settings = reachability::Settings::default();
                if let Answer::Complete(grounding) = ground(&Task::new(problem), &settings) {
                    domain.grounded += 1;
                    domain.actions += grounding.actions.len();
                }
                warnings
            }
            Err(diagnostics) => {
                let errors = diagnostics.errors().cloned().collect();
                domain.refused.push((row[4].clone(), errors));
                Vec::new()
            }
        };
        for warning in diagnostics {
            *domain.warnings.entry(warning.message).or_default() += 1;
        }
    }
    for row in rows(&folder.join("plans.csv")) {
        let read = read_problem(&source(folder, &row[3]), &source(folder, &row[4]));
        let Ok((problem, _)) = read else { continue };
        survey.plans.0 += 1;
        let steps = plan_steps(&source(folder, &row[5]), &Task::new(problem));
        let expected = row[7].parse().expect("a number of actions");
        if steps.is_ok_and(|steps| steps == expected) {
            survey.plans.1 += 1;
        }
    }
    survey
}

fn plan_steps(plan: &Source, task: &Task) -> Result<usize, Diagnostics> {
    read_plan(plan, task).map(|(plan, _)| plan.steps.len())
}

/// Returns the rows of a table without its head. No field contains a comma.
pub(crate) fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).expect("the benchmark set has its tables");
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

pub(crate) fn source(folder: &Path, path: &str) -> Source {
    let bytes = fs::read(folder.join(path)).expect("the files of the tables exist");
    Source::from_bytes(path, &bytes)
}
