//! Experiment files for perturbed worlds: `docs/research/perturbed-worlds.md`.

use std::collections::BTreeMap;

use crate::error::ExperimentError;
use crate::untimed::ExecutorName;
use crate::worlds::Perturbation;
use elbowroom_model::Task;
use elbowroom_model::problem::PredicateId;
use elbowroom_text::{Source, Span};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use toml::Spanned;

/// `format` of these files.
const FORMAT: &str = "elbowroom-perturbed-experiment";

/// Experiment, with the texts of all files that it names.
#[derive(Clone, Debug)]
pub struct PerturbedExperiment {
    /// The title.
    pub title: String,
    /// Number of trials of each case, world and executor.
    pub trials: u64,
    /// Random seed.
    pub seed: u64,
    /// Number of planning rounds of a trial.
    pub rounds: usize,
    /// The worlds.
    pub worlds: Vec<WorldKind>,
    /// The executors.
    pub executors: Vec<ExecutorName>,
    /// Facts that change spontaneously in the world as published.
    pub perturbation: Option<PerturbationNames>,
    /// The planner.
    pub planner: PlannerKind,
    /// The cases.
    pub cases: Vec<Case>,
}

/// Case: a problem with likelihoods.
#[derive(Clone, Debug)]
pub struct Case {
    /// The name.
    pub name: String,
    /// The domain, in PDDL.
    pub domain: String,
    /// The problem, in PDDL.
    pub problem: String,
    /// Maximum number of concurrent actions, for the optimum.
    pub most_running: usize,
    /// Other rules for which the optimum is also computed.
    pub also: Vec<OptimumRules>,
    /// Likelihood file (`docs/reference/formats/likelihoods.md`).
    pub likelihoods: String,
    /// Published measurements in the world as published.
    pub published: Option<Published>,
}

/// Published numbers of successes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Number of trials.
    pub trials: u64,
    /// Successes by executor.
    pub successes: BTreeMap<ExecutorName, u64>,
}

/// Model of a perturbed world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldKind {
    /// All draws are independent.
    Sound,
    /// The world that made the published results.
    AsPublished,
}

/// Planner, for the first plan and for replanning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlannerKind {
    /// Sequential plans with a minimum number of actions; of several such plans the one whose
    /// actions come first by schema and objects.
    #[default]
    Shortest,
    /// The embedded temporal planner.
    Embedded,
}

impl PlannerKind {
    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shortest => "shortest",
            Self::Embedded => "embedded",
        }
    }
}

impl WorldKind {
    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::AsPublished => "as-published",
        }
    }
}

/// Additional rules for the optimum. By the rules of the trials, a step that ends in a dead end
/// uses up a planning round, and over-all conditions are ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OptimumRules {
    /// A run in a dead end is lost.
    DeadEndsLost,
    /// An action whose over-all condition does not hold fails at once.
    OverAllKept,
    /// Both rules.
    DeadEndsLostOverAllKept,
}

impl OptimumRules {
    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::DeadEndsLost => "dead-ends-lost",
            Self::OverAllKept => "over-all-kept",
            Self::DeadEndsLostOverAllKept => "dead-ends-lost-over-all-kept",
        }
    }

    /// Returns `true` if a run in a dead end is lost.
    pub fn loses_dead_ends(self) -> bool {
        matches!(self, Self::DeadEndsLost | Self::DeadEndsLostOverAllKept)
    }

    /// Returns `true` if an action whose over-all condition does not hold fails at once.
    pub fn keeps_over_all(self) -> bool {
        matches!(self, Self::OverAllKept | Self::DeadEndsLostOverAllKept)
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
    /// Returns the predicates of a task.
    ///
    /// # Errors
    /// The domain has no predicate of that name.
    pub fn find(&self, task: &Task) -> Result<Perturbation, ExperimentError> {
        let count = u32::try_from(task.problem().predicates.len()).unwrap_or(u32::MAX);
        let find = |name: &str| {
            let is_it = |id: &PredicateId| {
                let predicate = &task.problem().predicates[id.index()];
                predicate.name.eq_ignore_ascii_case(name)
            };
            (0..count).map(PredicateId).find(is_it).ok_or_else(|| {
                ExperimentError::other(format!(
                    "[perturbation] names `{name}`, which is not a predicate of the domain"
                ))
            })
        };
        Ok(Perturbation {
            achieved: find(&self.achieved)?,
            needed: find(&self.needed)?,
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: Spanned<String>,
    version: Spanned<u64>,
    title: String,
    domain: Option<Spanned<String>>,
    problem: Option<Spanned<String>>,
    trials: u64,
    seed: u64,
    #[serde(default = "ten")]
    rounds: usize,
    worlds: Vec<WorldKind>,
    executors: Vec<ExecutorName>,
    perturbation: Option<PerturbationNames>,
    optimum: Option<OptimumFile>,
    #[serde(default)]
    planner: PlannerKind,
    #[serde(default)]
    include: Vec<Spanned<String>>,
    #[serde(default)]
    case: Vec<CaseFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OptimumFile {
    #[serde(default = "no_limit")]
    most_running: usize,
    #[serde(default)]
    also: Vec<OptimumRules>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    name: String,
    likelihoods: Spanned<String>,
    published: Option<Published>,
}

#[derive(Deserialize)]
struct Head {
    format: String,
}

fn no_limit() -> usize {
    usize::MAX
}

fn ten() -> usize {
    10
}

impl PerturbedExperiment {
    /// Returns all data on which the results depend, in a fixed order.
    pub(super) fn identity(&self) -> Value {
        // A new member must be listed here, as part of the identity or not.
        let Self {
            title: _,
            // The caller sets the number of trials.
            trials: _,
            seed,
            rounds,
            worlds,
            executors,
            perturbation,
            planner,
            cases,
        } = self;
        let perturbation = perturbation.as_ref().map(|it| [&it.achieved, &it.needed]);
        let cases = cases.iter().map(|case| {
            let Case {
                name,
                domain,
                problem,
                most_running,
                also,
                likelihoods,
                published,
            } = case;
            // The results contain the published figures.
            let published = published
                .as_ref()
                .map(|it| json!([it.trials, it.successes]));
            let own = json!([name, domain, problem, most_running, likelihoods, published]);
            // Omitted if empty, so that the identity of older results does not change.
            if also.is_empty() {
                own
            } else {
                json!([own, also])
            }
        });
        let worlds: Vec<&str> = worlds.iter().map(|world| world.name()).collect();
        json!([
            seed,
            rounds,
            worlds,
            executors,
            perturbation,
            planner.name(),
            cases.collect::<Vec<_>>(),
        ])
    }

    /// Returns `true` if the text has the format of such an experiment.
    pub fn is_experiment(text: &str) -> bool {
        toml::from_str::<Head>(text).is_ok_and(|head| head.format == FORMAT)
    }

    /// Reads an experiment; `file` reads the files that it names.
    ///
    /// # Errors
    /// A member is missing, misspelt or cannot be read.
    pub fn read(
        source: impl Into<Source>,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, ExperimentError> {
        let source = source.into();
        let read = parsed(&source)?;
        let wrong = |span: Span, message: &str| ExperimentError::at(&source, span, message);
        if read.trials == 0 || read.worlds.is_empty() || read.executors.is_empty() {
            return Err(wrong(
                read.format.span(),
                "the experiment is empty; expected at least one of `trials`, `worlds` and \
                 `executors`",
            ));
        }
        if read.worlds.contains(&WorldKind::AsPublished) && read.perturbation.is_none() {
            return Err(wrong(
                read.format.span(),
                "the world as published needs [perturbation], with `achieved` and `needed`",
            ));
        }
        let mut cases = Vec::new();
        for name in &read.include {
            let text = read_named(&source, name, file)?;
            cases.extend(Self::read_included(
                &Source::new(name.get_ref(), text),
                file,
            )?);
        }
        cases.extend(own_cases(&source, &read, file)?);
        if cases.is_empty() {
            return Err(wrong(
                read.format.span(),
                "there are no cases; write [[case]], or `include` files with cases",
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

    /// Reads the cases of another experiment.
    fn read_included(
        source: &Source,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Vec<Case>, ExperimentError> {
        let read = parsed(source)?;
        if let Some(name) = read.include.first() {
            let message = "a file that is included cannot include others";
            return Err(ExperimentError::at(source, name.span(), message));
        }
        own_cases(source, &read, file)
    }
}

/// Parses the file, and checks its version.
fn parsed(source: &Source) -> Result<File, ExperimentError> {
    let read: File =
        elbowroom_text::toml::read(source).map_err(|found| ExperimentError::Text(found.into()))?;
    if *read.version.get_ref() != 1 {
        let version = read.version.get_ref();
        let message = format!("unknown version {version}; this program reads version 1");
        return Err(ExperimentError::at(source, read.version.span(), message));
    }
    Ok(read)
}

/// Reads a file that another one names.
fn read_named(
    source: &Source,
    name: &Spanned<String>,
    file: &dyn Fn(&str) -> Result<String, String>,
) -> Result<String, ExperimentError> {
    file(name.get_ref()).map_err(|error| ExperimentError::at(source, name.span(), error))
}

/// Reads the cases of a file itself, with the files that it names.
fn own_cases(
    source: &Source,
    read: &File,
    file: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Vec<Case>, ExperimentError> {
    let given = |name: &Option<Spanned<String>>, what: &str| match name {
        Some(name) => read_named(source, name, file),
        None => Err(ExperimentError::at(
            source,
            read.format.span(),
            format!("there are cases, but `{what}` is missing"),
        )),
    };
    if read.case.is_empty() {
        return Ok(Vec::new());
    }
    let (domain, problem) = (
        given(&read.domain, "domain")?,
        given(&read.problem, "problem")?,
    );
    let most_running = read.optimum.as_ref().map(|optimum| optimum.most_running);
    let also = read.optimum.as_ref().map(|optimum| optimum.also.clone());
    let also = also.unwrap_or_default();
    let case = |case: &CaseFile| {
        Ok(Case {
            name: case.name.clone(),
            domain: domain.clone(),
            problem: problem.clone(),
            most_running: most_running.unwrap_or(usize::MAX),
            also: also.clone(),
            likelihoods: read_named(source, &case.likelihoods, file)?,
            published: case.published.clone(),
        })
    };
    read.case.iter().map(case).collect()
}
