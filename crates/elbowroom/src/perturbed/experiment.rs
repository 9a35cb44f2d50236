//! Experiment files for perturbed worlds: `docs/perturbed-worlds.md`.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::problem::PredicateId;
use elbowroom_sim::perturbed::Perturbation;
use serde::{Deserialize, Serialize};

/// The `format` of such files.
const FORMAT: &str = "elbowroom-perturbed-experiment";

/// An experiment, with the texts of all files that it names.
#[derive(Clone, Debug)]
pub struct PerturbedExperiment {
    /// What it shows.
    pub title: String,
    /// Trials of each case, world and executor.
    pub trials: u64,
    /// Where the dice begin.
    pub seed: u64,
    /// Planning rounds of a trial.
    pub rounds: usize,
    /// In which worlds.
    pub worlds: Vec<WorldKind>,
    /// With which executors.
    pub executors: Vec<ExecutorKind>,
    /// What changes by itself in the world as published.
    pub perturbation: Option<PerturbationNames>,
    /// Who plans.
    pub planner: PlannerKind,
    /// The cases.
    pub cases: Vec<Case>,
}

/// Likelihoods to try.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is called.
    pub name: String,
    /// The domain, in PDDL.
    pub domain: String,
    /// The problem, in PDDL.
    pub problem: String,
    /// For the optimum: how many actions are under way at once at most.
    pub most_running: usize,
    /// A likelihood file (`docs/formats/likelihoods.md`).
    pub likelihoods: String,
    /// What others have measured in the world as published.
    pub published: Option<Published>,
}

/// Successes that were published.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Of how many trials.
    pub trials: u64,
    /// By executor.
    pub successes: BTreeMap<ExecutorKind, u64>,
}

/// A model of a perturbed world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldKind {
    /// All draws are independent.
    Sound,
    /// As the published results were made.
    AsPublished,
}

/// An executor for worlds without time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExecutorKind {
    /// The baseline.
    Esterel,
    /// Olisipo as in the paper.
    Adaptable,
    /// Olisipo as its published program did it.
    AsPublished,
    /// Whatever is best in the sound world.
    Lookahead,
}

/// Who plans, at the beginning and after a plan was given up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlannerKind {
    /// As few actions as possible, one after the other; of several such plans the one whose
    /// actions come first by schema and objects.
    #[default]
    Shortest,
    /// The temporal planner that is built in.
    Embedded,
}

impl WorldKind {
    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::AsPublished => "as-published",
        }
    }
}

impl ExecutorKind {
    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Esterel => "esterel",
            Self::Adaptable => "adaptable",
            Self::AsPublished => "as-published",
            Self::Lookahead => "lookahead",
        }
    }
}

/// A [`Perturbation`] by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerturbationNames {
    achieved: String,
    needed: String,
}

impl PerturbationNames {
    /// The predicates of a task.
    ///
    /// # Errors
    /// When it has none of that name.
    pub fn find(&self, task: &Task) -> Result<Perturbation, PerturbedError> {
        let count = u32::try_from(task.problem().predicates.len()).unwrap_or(u32::MAX);
        let find = |name: &str| {
            let is_it = |id: &PredicateId| {
                let predicate = &task.problem().predicates[id.index()];
                predicate.name.eq_ignore_ascii_case(name)
            };
            (0..count).map(PredicateId).find(is_it).ok_or_else(|| {
                PerturbedError::other(format!(
                    "[perturbation] names `{name}`, and the domain has no such predicate"
                ))
            })
        };
        Ok(Perturbation {
            achieved: find(&self.achieved)?,
            needed: find(&self.needed)?,
        })
    }
}

/// An experiment that cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct PerturbedError {
    message: String,
}

impl PerturbedError {
    pub(crate) fn other(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "format")]
    _format: String,
    version: u64,
    title: String,
    domain: Option<String>,
    problem: Option<String>,
    trials: u64,
    seed: u64,
    #[serde(default = "ten")]
    rounds: usize,
    worlds: Vec<WorldKind>,
    executors: Vec<ExecutorKind>,
    perturbation: Option<PerturbationNames>,
    optimum: Option<OptimumFile>,
    #[serde(default)]
    planner: PlannerKind,
    #[serde(default)]
    include: Vec<String>,
    #[serde(default)]
    case: Vec<CaseFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OptimumFile {
    most_running: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    name: String,
    likelihoods: String,
    published: Option<Published>,
}

#[derive(Deserialize)]
struct Head {
    format: String,
}

fn ten() -> usize {
    10
}

impl PerturbedExperiment {
    /// Whether a text says that it is such an experiment.
    pub fn is_one(text: &str) -> bool {
        toml::from_str::<Head>(text).is_ok_and(|head| head.format == FORMAT)
    }

    /// Reads an experiment; `file` reads the files it names.
    ///
    /// # Errors
    /// When something is missing, misspelt or cannot be read.
    pub fn read(
        text: &str,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, PerturbedError> {
        let read: File =
            toml::from_str(text).map_err(|error| PerturbedError::other(error.to_string()))?;
        if read.version != 1 {
            return Err(PerturbedError::other(format!(
                "version {} is not known; this program reads version 1",
                read.version
            )));
        }
        if read.trials == 0 || read.worlds.is_empty() || read.executors.is_empty() {
            return Err(PerturbedError::other(
                "there is nothing to make; write at least one of `trials`, `worlds` and `executors`",
            ));
        }
        if read.worlds.contains(&WorldKind::AsPublished) && read.perturbation.is_none() {
            return Err(PerturbedError::other(
                "the world as published needs [perturbation], with `achieved` and `needed`",
            ));
        }
        let mut cases = Vec::new();
        for name in &read.include {
            let text = file(name).map_err(PerturbedError::other)?;
            cases.extend(Self::included(name, &text, file)?);
        }
        cases.extend(own_cases(&read, file)?);
        if cases.is_empty() {
            return Err(PerturbedError::other(
                "there are no cases; write [[case]], or `include` files that have some",
            ));
        }
        Ok(Self {
            title: read.title,
            trials: read.trials,
            seed: read.seed,
            rounds: read.rounds,
            worlds: read.worlds,
            executors: read.executors,
            perturbation: read.perturbation,
            planner: read.planner,
            cases,
        })
    }

    /// The cases of another experiment.
    fn included(
        name: &str,
        text: &str,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Vec<Case>, PerturbedError> {
        let wrong =
            |error: &dyn std::fmt::Display| PerturbedError::other(format!("{name}: {error}"));
        let read: File = toml::from_str(text).map_err(|error| wrong(&error))?;
        if !read.include.is_empty() {
            return Err(wrong(&"a file that is included cannot include others"));
        }
        own_cases(&read, file).map_err(|error| wrong(&error))
    }
}

/// The cases that a file has itself, with the files that it names.
fn own_cases(
    read: &File,
    file: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Vec<Case>, PerturbedError> {
    let file = |name: &str| file(name).map_err(PerturbedError::other);
    let named = |name: &Option<String>, what: &str| match name {
        Some(name) => file(name),
        None => Err(PerturbedError::other(format!(
            "there are cases, but no `{what}` that they are about"
        ))),
    };
    if read.case.is_empty() {
        return Ok(Vec::new());
    }
    let (domain, problem) = (
        named(&read.domain, "domain")?,
        named(&read.problem, "problem")?,
    );
    let most_running = read.optimum.as_ref().map(|optimum| optimum.most_running);
    let case = |case: &CaseFile| {
        Ok(Case {
            name: case.name.clone(),
            domain: domain.clone(),
            problem: problem.clone(),
            most_running: most_running.unwrap_or(usize::MAX),
            likelihoods: file(&case.likelihoods)?,
            published: case.published.clone(),
        })
    };
    read.case.iter().map(case).collect()
}
