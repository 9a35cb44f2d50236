//! Experiment files for perturbed worlds: `docs/perturbed-worlds.md`.

use std::collections::BTreeMap;

use crate::untimed::ExecutorName;
use crate::worlds::Perturbation;
use elbowroom_model::Task;
use elbowroom_model::problem::PredicateId;
use elbowroom_text::{Diagnostic, Diagnostics, Severity, Source, Span};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use toml::Spanned;

/// The `format` of such files.
const FORMAT: &str = "elbowroom-perturbed-experiment";

/// An experiment, with the texts of all files that it names.
#[derive(Clone, Debug)]
pub struct PerturbedExperiment {
    /// The title.
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
    pub executors: Vec<ExecutorName>,
    /// The facts that change by themselves in the world as published.
    pub perturbation: Option<PerturbationNames>,
    /// The planner.
    pub planner: PlannerKind,
    /// The cases.
    pub cases: Vec<Case>,
}

/// Likelihoods to try.
#[derive(Clone, Debug)]
pub struct Case {
    /// The name.
    pub name: String,
    /// The domain, in PDDL.
    pub domain: String,
    /// The problem, in PDDL.
    pub problem: String,
    /// For the optimum: how many actions are under way at once at most.
    pub most_running: usize,
    /// By which other rules the optimum is calculated, too.
    pub also: Vec<OptimumRules>,
    /// A likelihood file (`docs/formats/likelihoods.md`).
    pub likelihoods: String,
    /// Measurements by others in the world as published.
    pub published: Option<Published>,
}

/// Successes that were published.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Of how many trials.
    pub trials: u64,
    /// By executor.
    pub successes: BTreeMap<ExecutorName, u64>,
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

/// The planner, for the first plan and for replanning.
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

impl PlannerKind {
    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shortest => "shortest",
            Self::Embedded => "embedded",
        }
    }
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

/// Rules by which the optimum is calculated beside those of the trials. Those are: a step that ends
/// in a dead end uses up a planning round; conditions over all are not looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OptimumRules {
    /// A run in a dead end is lost.
    DeadEndsLost,
    /// An action without what it needs over all breaks off at once.
    OverAllKept,
    /// Both.
    DeadEndsLostOverAllKept,
}

impl OptimumRules {
    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::DeadEndsLost => "dead-ends-lost",
            Self::OverAllKept => "over-all-kept",
            Self::DeadEndsLostOverAllKept => "dead-ends-lost-over-all-kept",
        }
    }

    /// Whether a run in a dead end is lost.
    pub fn loses_dead_ends(self) -> bool {
        matches!(self, Self::DeadEndsLost | Self::DeadEndsLostOverAllKept)
    }

    /// Whether an action without what it needs over all breaks off at once.
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
pub enum PerturbedError {
    /// The file, or one that it names, is wrong.
    #[error("{0}")]
    Text(Diagnostics),
    /// Something else is.
    #[error("{0}")]
    Other(String),
}

impl PerturbedError {
    pub(crate) fn other(message: impl Into<String>) -> Self {
        Self::Other(message.into())
    }

    /// The file is wrong there.
    fn at(source: &Source, span: Span, message: impl Into<String>) -> Self {
        let found = Diagnostic::new(Severity::Error, source, span, message);
        Self::Text(found.into())
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
    /// All that the results depend on, in an order that stays.
    pub(super) fn identity(&self) -> Value {
        // Whoever adds a member says here whether results depend on it.
        let Self {
            title: _,
            // That many are made as whoever makes them says.
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
            // Results have these figures beside their own.
            let published = published
                .as_ref()
                .map(|it| json!([it.trials, it.successes]));
            let own = json!([name, domain, problem, most_running, likelihoods, published]);
            // Results of experiments that do not ask for it stay what they are.
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

    /// Whether a text says that it is such an experiment.
    pub fn is_one(text: &str) -> bool {
        toml::from_str::<Head>(text).is_ok_and(|head| head.format == FORMAT)
    }

    /// Reads an experiment; `file` reads the files it names.
    ///
    /// # Errors
    /// When something is missing, misspelt or cannot be read.
    pub fn read(
        source: impl Into<Source>,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, PerturbedError> {
        let source = source.into();
        let read = parsed(&source)?;
        let wrong = |span: Span, message: &str| PerturbedError::at(&source, span, message);
        if read.trials == 0 || read.worlds.is_empty() || read.executors.is_empty() {
            return Err(wrong(
                read.format.span(),
                "there is nothing to make; write at least one of `trials`, `worlds` and `executors`",
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
            let text = named(&source, name, file)?;
            cases.extend(Self::included(&Source::new(name.get_ref(), text), file)?);
        }
        cases.extend(own_cases(&source, &read, file)?);
        if cases.is_empty() {
            return Err(wrong(
                read.format.span(),
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
        source: &Source,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Vec<Case>, PerturbedError> {
        let read = parsed(source)?;
        if let Some(name) = read.include.first() {
            let message = "a file that is included cannot include others";
            return Err(PerturbedError::at(source, name.span(), message));
        }
        own_cases(source, &read, file)
    }
}

/// The file as it stands, of a version that is known.
fn parsed(source: &Source) -> Result<File, PerturbedError> {
    let read: File =
        elbowroom_text::toml::read(source).map_err(|found| PerturbedError::Text(found.into()))?;
    if *read.version.get_ref() != 1 {
        let version = read.version.get_ref();
        let message = format!("version {version} is not known; this program reads version 1");
        return Err(PerturbedError::at(source, read.version.span(), message));
    }
    Ok(read)
}

/// The text of a file that another one names.
fn named(
    source: &Source,
    name: &Spanned<String>,
    file: &dyn Fn(&str) -> Result<String, String>,
) -> Result<String, PerturbedError> {
    file(name.get_ref()).map_err(|error| PerturbedError::at(source, name.span(), error))
}

/// The cases that a file has itself, with the files that it names.
fn own_cases(
    source: &Source,
    read: &File,
    file: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Vec<Case>, PerturbedError> {
    let given = |name: &Option<Spanned<String>>, what: &str| match name {
        Some(name) => named(source, name, file),
        None => Err(PerturbedError::at(
            source,
            read.format.span(),
            format!("there are cases, but no `{what}` that they are about"),
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
            likelihoods: named(source, &case.likelihoods, file)?,
            published: case.published.clone(),
        })
    };
    read.case.iter().map(case).collect()
}
