//! What do logs say about the world, and will the next run stay inside the plan's envelope?

mod changes;
mod courses;
mod inside;
mod other_problem;
mod prediction;
mod timeouts;

use elbowroom_learning::fit::Fit;
use elbowroom_learning::learn::{self, Durations, Group, Learnt};
use elbowroom_learning::records::{self, Outcome, Record};
use elbowroom_learning::{table, world};
use elbowroom_report::trace::{Stored, TraceError};
use elbowroom_sim::{Distribution, Failure, WorldModel};
use elbowroom_text::{Diagnostics, Source};
use serde::{Deserialize, Serialize};

use super::{RequestError, Version, Watcher};

use changes::Expected;
use prediction::Predictions;

pub use changes::{ChangesLearnt, RateLearnt};
pub use courses::Course;
pub use elbowroom_learning::learn::Settings;
pub use inside::{ConformalBox, ConformalInterval, InsideRequest, Verdict};
pub use other_problem::known_sections;
pub use prediction::{PredictionAnswer, predictions_for};

/// Asks what logs say.
#[derive(Clone, Debug)]
pub struct LearnRequest {
    /// The logs, oldest first.
    pub logs: Vec<Log>,
    /// How to learn.
    pub settings: Settings,
    /// Whether the next run will stay inside the envelope of a plan, if that is asked.
    pub inside: Option<InsideRequest>,
    /// The world file that was expected, if changes by themselves are to be compared with it.
    pub expected: Option<Source>,
}

/// The content of one log.
#[derive(Clone, Debug)]
pub struct Log {
    /// The name of the log, such as its file.
    pub name: String,
    /// The attempts to execute actions, in order.
    pub records: Vec<Record>,
    /// What became of the facts; `None` where the log does not say, as tables do not.
    pub course: Option<Course>,
    /// The believed world of the run; `None` if it had none, or if the log does not contain it.
    pub world: Option<WorldModel>,
}

/// A log that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// It is a trace, and damaged.
    #[error("{name}: {error}")]
    Trace {
        /// The name of the log.
        name: String,
        /// The error in it.
        error: TraceError,
    },
    /// It is a table with mistakes.
    #[error(transparent)]
    Table(#[from] Diagnostics),
}

impl Log {
    /// Reads a trace of a run (`docs/formats/trace.md`), or a table (`docs/formats/log-csv.md`).
    /// What begins with `{` is a trace.
    ///
    /// # Errors
    /// When it is neither, with the place of the mistake.
    pub fn read(source: &Source) -> Result<Self, LogError> {
        let name = source.name().to_owned();
        if !source.text().trim_start().starts_with('{') {
            return Ok(Self {
                name,
                records: table::read(source)?,
                course: None,
                world: None,
            });
        }
        match Stored::read(source.text()) {
            Ok(trace) => {
                let course = Course::of(&trace);
                Ok(Self {
                    name,
                    records: records::of_trace(&trace),
                    world: course.as_ref().and_then(|course| course.believed(&trace)),
                    course,
                })
            }
            Err(error) => Err(LogError::Trace { name, error }),
        }
    }
}

/// The result of learning from logs: `docs/formats/learn-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnAnswer {
    /// Always the same.
    pub format: LearnFormat,
    /// Always the same.
    pub version: Version,
    /// The names of the logs, oldest first.
    pub logs: Vec<String>,
    /// How many attempts there were.
    pub attempts: usize,
    /// Statistics of the attempts, by the actions' names.
    pub actions: Vec<ActionLearnt>,
    /// How often facts change by themselves: those of each predicate of which one did, or was
    /// expected to.
    #[serde(default)]
    pub changes: Vec<ChangesLearnt>,
    /// All of it as a world file.
    pub world: String,
    /// The [time-outs](elbowroom_execution::run::TimeoutRule) that follow from the durations: twice the longest of 10,000
    /// that are drawn from the distribution of an action, and of all that ended in the logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeouts: Option<String>,
    /// Intervals for the next run, if they were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside: Option<ConformalBox>,
}

/// The name of the document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LearnFormat {
    /// The only one.
    #[default]
    #[serde(rename = "elbowroom-learn")]
    Learn,
}

/// Statistics of the attempts to execute actions of one name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionLearnt {
    /// The name: `drive`.
    pub action: String,
    /// How many attempts there were.
    pub attempts: usize,
    /// How durations are described.
    pub durations: DurationsLearnt,
    /// How long after the command the actions start; `None` if at once, or if no log says.
    pub delay: Option<FitAnswer>,
    /// How often they fail.
    pub failures: FailuresLearnt,
    /// Whether durations change from log to log; `None` where each ground action is described
    /// apart.
    pub drift: Option<DriftAnswer>,
    /// Whether the frequency of failures does.
    pub failure_drift: DriftAnswer,
    /// Predictions of the believed world, or of the world file that was expected; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prediction: Option<PredictionAnswer>,
}

/// How durations are described.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "described", rename_all = "kebab-case")]
pub enum DurationsLearnt {
    /// Not at all: nothing was seen to its end, or there are none.
    Unknown,
    /// In seconds, all alike.
    Together {
        /// By this.
        #[serde(flatten)]
        group: GroupAnswer,
    },
    /// As multiples of the planned duration.
    Relative {
        /// By this.
        #[serde(flatten)]
        group: GroupAnswer,
    },
    /// In seconds, each ground action by itself.
    Apart {
        /// By these.
        groups: Vec<NamedGroup>,
    },
}

/// A group of durations that is described by one distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupAnswer {
    /// How many were seen to their end.
    pub observed: usize,
    /// Of how many only a lower bound is known.
    pub censored: usize,
    /// The distribution.
    #[serde(flatten)]
    pub fit: FitAnswer,
}

/// The durations of one ground action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedGroup {
    /// The action: `(drive rover depot shelf)`.
    pub action: String,
    /// How it is described.
    #[serde(flatten)]
    pub group: GroupAnswer,
}

/// A distribution that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitAnswer {
    /// `constant`, `normal`, `lognormal`, `uniform` or `values`.
    pub family: String,
    /// Its numbers, by their names in world files.
    pub numbers: Vec<(String, f64)>,
    /// Its mean.
    pub mean: f64,
    /// The standard error of the mean, where the family has one.
    pub standard_error: Option<f64>,
    /// Whether it explains the samples badly.
    pub doubtful: bool,
}

/// How often actions fail.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailuresLearnt {
    /// How many failed.
    pub failed: u64,
    /// Of how many that were neither cancelled nor still running.
    pub ended: u64,
    /// Wilson's 95 % interval of the probability; `None` if none ended.
    pub interval: Option<(f64, f64)>,
    /// `start`, `midway` or `end`; `None` if none failed.
    pub when: Option<String>,
    /// After how many failures what the start had changed was as before, and of how many failures logs tell that; `None` if
    /// of none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undone: Option<(u64, u64)>,
}

/// Whether values change from log to log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriftAnswer {
    /// The largest value of the test martingale.
    pub evidence: f64,
    /// The number, from 1, of the value at which it reached the limit; `None` if it did not.
    pub since: Option<usize>,
}

/// Says what logs tell about the world.
///
/// # Errors
/// When the plan that is asked about has no envelope that can be computed, when the world that was
/// expected does not go with the problem of a log, or when no log tells of facts with which it
/// could be compared. That the logs are too few for an answer is an answer.
pub fn learn(
    request: &LearnRequest,
    watcher: &mut dyn Watcher,
) -> Result<LearnAnswer, RequestError> {
    let records: Vec<Record> = request
        .logs
        .iter()
        .flat_map(|log| log.records.iter().cloned())
        .collect();
    let mut learnt = learn::learn(&records, &request.settings);
    let courses = request.logs.iter().filter_map(|log| log.course.as_ref());
    for (name, is_undone) in courses.flat_map(Course::undone) {
        if let Some(of_name) = learnt.iter_mut().find(|it| it.name == name) {
            of_name.undone.add(is_undone);
        }
    }
    let expected = match &request.expected {
        Some(world) => Some(Expected::new(&request.logs, world)?),
        None => None,
    };
    let predictions = predictions(request);
    let changes = changes::of(&request.logs);
    let told = |changes| ChangesLearnt::of(changes, expected.as_ref());
    let mut told: Vec<ChangesLearnt> = changes.iter().map(told).collect();
    told.extend(expected.iter().flat_map(|it| it.unseen(&changes)));
    told.sort_by(|a, b| (&a.predicate, a.becomes).cmp(&(&b.predicate, b.becomes)));
    let inside = match &request.inside {
        Some(inside) => Some(inside::answer(inside, &learnt, watcher)?),
        None => None,
    };
    Ok(LearnAnswer {
        format: LearnFormat::Learn,
        version: Version,
        logs: request.logs.iter().map(|log| log.name.clone()).collect(),
        attempts: records.len(),
        actions: learnt
            .iter()
            .map(|it| ActionLearnt::of(it, predictions.of(&it.name)))
            .collect(),
        changes: told,
        world: world::write(&learnt, &changes, request.settings.resolution),
        timeouts: timeouts::of(&learnt).map(|rule| rule.to_string()),
        inside,
    })
}

/// Returns the predictions of the expected world file, or, without one, of the world that each log believed.
fn predictions(request: &LearnRequest) -> Predictions {
    let mut predictions = Predictions::default();
    for log in &request.logs {
        let expected = request.expected.as_ref().zip(log.course.as_ref());
        let expected = expected.and_then(|(world, course)| course.read(world));
        if let Some(world) = expected.as_ref().or(log.world.as_ref()) {
            predictions.add(&log.records, world);
        }
    }
    predictions
}

/// What a log expected beside what happened, action by action: the mean planned and the mean actual
/// duration of all attempts that succeeded and had a planned duration.
pub fn expectation_and_reality(records: &[Record], name: &str) -> Option<(f64, f64)> {
    let pairs: Vec<(f64, f64)> = records
        .iter()
        .filter(|record| record.name() == name && record.outcome == Outcome::Succeeded)
        .filter_map(|record| Some((record.planned?, record.end - record.start?)))
        .collect();
    #[allow(
        clippy::cast_precision_loss,
        reason = "counts of records are far below 2^53"
    )]
    let count = pairs.len() as f64;
    let sum = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    (!pairs.is_empty()).then(|| (sum(|pair| pair.0), sum(|pair| pair.1)))
}

impl ActionLearnt {
    fn of(learnt: &Learnt, prediction: Option<PredictionAnswer>) -> Self {
        let failures = learnt.failures;
        Self {
            action: learnt.name.clone(),
            attempts: learnt.attempts,
            durations: DurationsLearnt::of(&learnt.durations),
            delay: learnt.delay.as_ref().map(FitAnswer::of),
            failures: FailuresLearnt {
                failed: failures.successes,
                ended: failures.count,
                interval: failures.wilson(),
                when: (failures.successes > 0).then(|| {
                    let when = match learnt.when {
                        Failure::AtStart => "start",
                        Failure::Midway => "midway",
                        Failure::AtEnd => "end",
                    };
                    when.to_owned()
                }),
                undone: (learnt.undone.count > 0)
                    .then_some((learnt.undone.successes, learnt.undone.count)),
            },
            drift: match learnt.durations {
                Durations::Together(_) | Durations::Relative(_) => {
                    Some(DriftAnswer::of(&learnt.drift))
                }
                Durations::Apart(_) | Durations::Unknown => None,
            },
            failure_drift: DriftAnswer::of(&learnt.failure_drift),
            prediction,
        }
    }
}

impl DriftAnswer {
    fn of(drift: &elbowroom_learning::drift::Drift) -> Self {
        Self {
            evidence: drift.evidence,
            since: drift.since.map(|position| position + 1),
        }
    }
}

impl DurationsLearnt {
    fn of(durations: &Durations) -> Self {
        match durations {
            Durations::Unknown => Self::Unknown,
            Durations::Together(group) => Self::Together {
                group: GroupAnswer::of(group),
            },
            Durations::Relative(group) => Self::Relative {
                group: GroupAnswer::of(group),
            },
            Durations::Apart(groups) => Self::Apart {
                groups: groups
                    .iter()
                    .map(|(action, group)| NamedGroup {
                        action: action.clone(),
                        group: GroupAnswer::of(group),
                    })
                    .collect(),
            },
        }
    }
}

impl GroupAnswer {
    fn of(group: &Group) -> Self {
        let (observed, censored) = group.counts();
        Self {
            observed,
            censored,
            fit: FitAnswer::of(&group.fit),
        }
    }
}

impl FitAnswer {
    fn of(fit: &Fit) -> Self {
        let (family, numbers): (&str, Vec<(&str, f64)>) = match &fit.distribution {
            Distribution::Constant(value) => ("constant", vec![("constant", *value)]),
            Distribution::Normal { mean, deviation } => {
                ("normal", vec![("mean", *mean), ("deviation", *deviation)])
            }
            Distribution::LogNormal { mean, deviation } => (
                "lognormal",
                vec![("mean", *mean), ("deviation", *deviation)],
            ),
            Distribution::Uniform { from, to } => ("uniform", vec![("from", *from), ("to", *to)]),
            Distribution::Triangular { from, mode, to } => (
                "triangular",
                vec![("from", *from), ("mode", *mode), ("to", *to)],
            ),
            Distribution::Exponential { from, mean } => {
                ("exponential", vec![("from", *from), ("mean", *mean)])
            }
            Distribution::Gamma { from, shape, scale } => (
                "gamma",
                vec![("from", *from), ("shape", *shape), ("scale", *scale)],
            ),
            Distribution::Empirical(_) => ("values", Vec::new()),
        };
        let named = |(name, value): (&str, f64)| (name.to_owned(), value);
        Self {
            family: family.to_owned(),
            numbers: numbers.into_iter().map(named).collect(),
            mean: fit.mean,
            standard_error: fit.standard_error,
            doubtful: fit.is_doubtful,
        }
    }
}
