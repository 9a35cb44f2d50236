//! Experiment files for perturbed worlds: `docs/perturbed-worlds.md`.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::problem::PredicateId;
use elbowroom_sim::perturbed::Perturbation;
use serde::Deserialize;

/// The `format` of such files.
const FORMAT: &str = "elbowroom-perturbed-experiment";

/// An experiment, with the texts of all files that it names.
#[derive(Clone, Debug)]
pub struct PerturbedExperiment {
    /// What it shows.
    pub title: String,
    /// The domain, in PDDL.
    pub domain: String,
    /// The problem, in PDDL.
    pub problem: String,
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
    /// For the optimum: how many actions are under way at once at most.
    pub most_running: usize,
    /// The cases.
    pub cases: Vec<Case>,
}

/// Likelihoods to try.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is called.
    pub name: String,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldKind {
    /// All draws are independent.
    Sound,
    /// As the published results were made.
    AsPublished,
}

/// An executor for worlds without time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
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
    domain: String,
    problem: String,
    trials: u64,
    seed: u64,
    #[serde(default = "ten")]
    rounds: usize,
    worlds: Vec<WorldKind>,
    executors: Vec<ExecutorKind>,
    perturbation: Option<PerturbationNames>,
    optimum: Option<OptimumFile>,
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
        if read.worlds.contains(&WorldKind::AsPublished) && read.perturbation.is_none() {
            return Err(PerturbedError::other(
                "the world as published needs [perturbation], with `achieved` and `needed`",
            ));
        }
        let file = |name: &str| file(name).map_err(PerturbedError::other);
        let case = |case: CaseFile| {
            Ok(Case {
                likelihoods: file(&case.likelihoods)?,
                name: case.name,
                published: case.published,
            })
        };
        Ok(Self {
            domain: file(&read.domain)?,
            problem: file(&read.problem)?,
            title: read.title,
            trials: read.trials,
            seed: read.seed,
            rounds: read.rounds,
            worlds: read.worlds,
            executors: read.executors,
            perturbation: read.perturbation,
            most_running: read
                .optimum
                .map_or(usize::MAX, |optimum| optimum.most_running),
            cases: read.case.into_iter().map(case).collect::<Result<_, _>>()?,
        })
    }
}
