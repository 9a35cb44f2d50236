//! Reads all problems and plans of the benchmark set, makes the problems ground, and sums up what
//! became of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use elbowroom_model::Task;
use elbowroom_model::reachability::{self, Answer, ground};
use elbowroom_pddl::{Diagnostic, Diagnostics, Feature, Source, read_plan, read_problem};

/// What became of all texts.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    /// By collection and domain, in the order of the manifest.
    pub(crate) domains: Vec<Domain>,
    /// Plans of problems that were read, and plans that were read.
    pub(crate) plans: (usize, usize),
}

/// What became of the instances of one domain.
#[derive(Debug, Default)]
pub(crate) struct Domain {
    /// `collection/domain`
    pub(crate) name: String,
    /// How many problems there are.
    pub(crate) instances: usize,
    /// How many of them were read.
    pub(crate) read: usize,
    /// How many of these were made ground, within the limits.
    pub(crate) grounded: usize,
    /// How many ground actions can be reached in them, all together.
    pub(crate) actions: usize,
    /// The refused ones, with all errors.
    pub(crate) refused: Vec<(String, Vec<Diagnostic>)>,
    /// How often each thing was warned of.
    pub(crate) warnings: BTreeMap<String, usize>,
}

/// Why a problem was refused: the names of the features it uses, or that it contains mistakes.
pub(crate) fn reason(errors: &[Diagnostic]) -> String {
    if errors.iter().any(|error| Feature::of(error).is_none()) {
        return "mistakes".to_owned();
    }
    let features: BTreeSet<_> = errors.iter().filter_map(Feature::of).collect();
    let names: Vec<_> = features.iter().map(|feature| feature.name()).collect();
    names.join(", ")
}

/// The folder of the benchmark set: below `ELBOWROOM_SHARED`, or beside the repository.
pub(crate) fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("ELBOWROOM_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    Some(shared.join("data/pddl")).filter(|folder| folder.is_dir())
}

/// Reads everything. Panics where a file of the manifest is missing.
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

/// The rows of a table without its head. None of its fields contains a comma.
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
