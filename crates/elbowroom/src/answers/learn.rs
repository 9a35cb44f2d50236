//! Models of the world learnt from logs, and predictions whether the next run stays inside the
//! plan's envelope.

mod changes;
mod conformal_box;
mod fact_history;
mod known_sections;
mod prediction;
mod text;
mod timeouts;

use elbowroom_learning::fit::Fit;
use elbowroom_learning::learn::{self, Durations, Group, Learnt};
use elbowroom_learning::records::{self, Outcome, Record};
use elbowroom_learning::{table, world};
use elbowroom_report::trace::{Stored, TraceError};
use elbowroom_sim::{Distribution, FailureTime, WorldModel};
use elbowroom_text::{Diagnostics, Source};
use serde::{Deserialize, Serialize};

use super::{Observer, RequestError, Version};

use changes::ExpectedChanges;
use prediction::Predictions;

pub use changes::{LearntChanges, LearntRate};
pub use conformal_box::{ConformalBox, ConformalInterval, ConformalRequest, Verdict};
pub use elbowroom_learning::learn::Settings;
pub use fact_history::FactHistory;
pub use known_sections::known_sections;
pub use prediction::{PredictionAnswer, predictions_for};

/// Requests a model of the world from logs.
#[derive(Clone, Debug)]
pub struct LearnRequest {
    /// The logs, oldest first.
    pub logs: Vec<Log>,
    /// Settings of the learner.
    pub settings: Settings,
    /// A plan, to predict whether the next run stays inside its envelope.
    pub conformal_box: Option<ConformalRequest>,
    /// The expected world file, if changes by themselves are to be compared with it.
    pub expected: Option<Source>,
}

/// The content of one log.
#[derive(Clone, Debug)]
pub struct Log {
    /// The name of the log, such as its file.
    pub name: String,
    /// The attempts to execute actions, in order.
    pub records: Vec<Record>,
    /// Changes of facts; `None` if the log does not contain them, such as a table.
    pub fact_history: Option<FactHistory>,
    /// The believed world of the run; `None` if it had none, or if the log does not contain it.
    pub world: Option<WorldModel>,
}

/// A log that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// A damaged trace.
    #[error("{name}: {error}")]
    Trace {
        /// The name of the log.
        name: String,
        /// The error in it.
        error: TraceError,
    },
    /// A table with errors.
    #[error(transparent)]
    Table(#[from] Diagnostics),
}

impl Log {
    /// Reads a trace of a run (`docs/reference/formats/trace.md`), or a table (`docs/reference/formats/log-csv.md`). A
    /// text that begins with `{` is a trace.
    ///
    /// # Errors
    /// When it is neither, with the place of the mistake.
    pub fn read(source: &Source) -> Result<Self, LogError> {
        let name = source.name().to_owned();
        if !source.text().trim_start().starts_with('{') {
            return Ok(Self {
                name,
                records: table::read(source)?,
                fact_history: None,
                world: None,
            });
        }
        match Stored::read(source.text()) {
            Ok(trace) => {
                let course = FactHistory::of(&trace);
                Ok(Self {
                    name,
                    records: records::of_trace(&trace),
                    world: course
                        .as_ref()
                        .and_then(|course| course.believed_world(&trace)),
                    fact_history: course,
                })
            }
            Err(error) => Err(LogError::Trace { name, error }),
        }
    }
}

/// The result of learning from logs: `docs/reference/formats/learn-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnAnswer {
    /// Format of the document.
    pub format: LearnFormat,
    /// Version of the document.
    pub version: Version,
    /// The names of the logs, oldest first.
    pub logs: Vec<String>,
    /// Number of attempts.
    pub attempts: usize,
    /// Statistics of the attempts, by the actions' names.
    pub actions: Vec<LearntAction>,
    /// Rates of facts that change by themselves, for each predicate with an observed or expected
    /// change.
    #[serde(default)]
    pub changes: Vec<LearntChanges>,
    /// The learnt world file.
    pub world: String,
    /// The [time-outs](elbowroom_execution::run::TimeoutRule) that follow from the durations: twice
    /// the longest of 10,000 draws from the distribution of an action, and of all that ended in the
    /// logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeouts: Option<String>,
    /// Intervals for the next run, if requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside: Option<ConformalBox>,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LearnFormat {
    /// The name `elbowroom-learn`.
    #[default]
    #[serde(rename = "elbowroom-learn")]
    Learn,
}

/// Statistics of the attempts to execute actions of one name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntAction {
    /// The name: `drive`.
    pub action: String,
    /// Number of attempts.
    pub attempts: usize,
    /// Description of the durations.
    pub durations: LearntDurations,
    /// Delay from the command to the start of the action; `None` if there is none, or if no log
    /// contains it.
    pub delay: Option<FitAnswer>,
    /// Statistics of failures.
    pub failures: LearntFailures,
    /// Change of the durations from log to log; `None` if each ground action is described
    /// separately.
    pub drift: Option<DriftAnswer>,
    /// Change of the failure rate from log to log.
    pub failure_drift: DriftAnswer,
    /// Predictions of the believed world, or of the expected world file; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prediction: Option<PredictionAnswer>,
}

/// Description of the durations of actions of one name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "described", rename_all = "kebab-case")]
pub enum LearntDurations {
    /// No description: no action was observed to its end, or the actions have no durations.
    Unknown,
    /// In seconds, all ground actions together.
    Together {
        /// The distribution.
        #[serde(flatten)]
        group: GroupAnswer,
    },
    /// As multiples of the planned duration.
    Relative {
        /// The distribution.
        #[serde(flatten)]
        group: GroupAnswer,
    },
    /// In seconds, each ground action separately.
    Apart {
        /// The distributions.
        groups: Vec<NamedGroup>,
    },
}

/// A group of durations that is described by one distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupAnswer {
    /// Number of durations that were observed to their end.
    pub observed: usize,
    /// Number of right-censored durations: only a lower bound is known.
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
    /// Description of its durations.
    #[serde(flatten)]
    pub group: GroupAnswer,
}

/// A fitted distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitAnswer {
    /// `constant`, `normal`, `lognormal`, `uniform` or `values`.
    pub family: String,
    /// Its parameters, by their names in world files.
    pub numbers: Vec<(String, f64)>,
    /// Its mean.
    pub mean: f64,
    /// The standard error of the mean, where the family has one.
    pub standard_error: Option<f64>,
    /// `true` if the distribution fits the samples badly.
    pub doubtful: bool,
}

/// Statistics of failures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntFailures {
    /// Number of failed attempts.
    pub failed: u64,
    /// Number of attempts that were neither cancelled nor still running.
    pub ended: u64,
    /// Wilson's 95 % interval of the probability; `None` if none ended.
    pub interval: Option<(f64, f64)>,
    /// `start`, `midway` or `end`; `None` if none failed.
    pub when: Option<String>,
    /// Number of failures that undid the effects of the start, and number of failures for which the
    /// logs show this; `None` if there is no such failure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undone: Option<(u64, u64)>,
}

/// Test whether values change from log to log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriftAnswer {
    /// The largest value of the test martingale.
    pub evidence: f64,
    /// The number, from 1, of the value at which it reached the limit; `None` if it did not.
    pub since: Option<usize>,
}

/// Learns a model of the world from logs.
///
/// Too few logs are reported in the answer, not as an error.
///
/// # Errors
/// When the envelope of the given plan cannot be computed, when the expected world does not match
/// the problem of a log, or when no log contains facts to compare it with.
pub fn learn(
    request: &LearnRequest,
    watcher: &mut dyn Observer,
) -> Result<LearnAnswer, RequestError> {
    let records: Vec<Record> = request
        .logs
        .iter()
        .flat_map(|log| log.records.iter().cloned())
        .collect();
    let mut learnt = learn::learn(&records, &request.settings);
    let courses = request
        .logs
        .iter()
        .filter_map(|log| log.fact_history.as_ref());
    for (name, is_undone) in courses.flat_map(FactHistory::undone_effects) {
        if let Some(of_name) = learnt.iter_mut().find(|it| it.name == name) {
            of_name.undone.add(is_undone);
        }
    }
    let expected = match &request.expected {
        Some(world) => Some(ExpectedChanges::new(&request.logs, world)?),
        None => None,
    };
    let predictions = predictions(request);
    let changes = changes::of(&request.logs);
    let told = |changes| LearntChanges::of(changes, expected.as_ref());
    let mut told: Vec<LearntChanges> = changes.iter().map(told).collect();
    told.extend(expected.iter().flat_map(|it| it.unobserved(&changes)));
    told.sort_by(|a, b| (&a.predicate, a.becomes).cmp(&(&b.predicate, b.becomes)));
    let inside = match &request.conformal_box {
        Some(inside) => Some(conformal_box::answer(inside, &learnt, watcher)?),
        None => None,
    };
    Ok(LearnAnswer {
        format: LearnFormat::Learn,
        version: Version,
        logs: request.logs.iter().map(|log| log.name.clone()).collect(),
        attempts: records.len(),
        actions: learnt
            .iter()
            .map(|it| LearntAction::of(it, predictions.of(&it.name)))
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
        let expected = request.expected.as_ref().zip(log.fact_history.as_ref());
        let expected = expected.and_then(|(world, course)| course.read(world));
        if let Some(world) = expected.as_ref().or(log.world.as_ref()) {
            predictions.add(&log.records, world);
        }
    }
    predictions
}

/// Returns the mean planned and the mean actual duration of an action: of all attempts that
/// succeeded and had a planned duration. `None` if there are none.
pub fn mean_planned_and_actual(records: &[Record], name: &str) -> Option<(f64, f64)> {
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

impl LearntAction {
    fn of(learnt: &Learnt, prediction: Option<PredictionAnswer>) -> Self {
        let failures = learnt.failures;
        Self {
            action: learnt.name.clone(),
            attempts: learnt.attempts,
            durations: LearntDurations::of(&learnt.durations),
            delay: learnt.delay.as_ref().map(FitAnswer::of),
            failures: LearntFailures {
                failed: failures.successes,
                ended: failures.count,
                interval: failures.wilson(),
                when: (failures.successes > 0).then(|| {
                    let when = match learnt.failure_time {
                        FailureTime::AtStart => "start",
                        FailureTime::Midway => "midway",
                        FailureTime::AtEnd => "end",
                    };
                    when.to_owned()
                }),
                undone: (learnt.undone.count > 0)
                    .then_some((learnt.undone.successes, learnt.undone.count)),
            },
            drift: match learnt.durations {
                Durations::Pooled(_) | Durations::Relative(_) => {
                    Some(DriftAnswer::of(&learnt.drift))
                }
                Durations::PerAction(_) | Durations::Unknown => None,
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

impl LearntDurations {
    fn of(durations: &Durations) -> Self {
        match durations {
            Durations::Unknown => Self::Unknown,
            Durations::Pooled(group) => Self::Together {
                group: GroupAnswer::of(group),
            },
            Durations::Relative(group) => Self::Relative {
                group: GroupAnswer::of(group),
            },
            Durations::PerAction(groups) => Self::Apart {
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
