//! The answer as a document: `docs/reference/formats/envelope-json.md`.

use elbowroom_envelope::{Growth, Guarantee, Method};
use elbowroom_execution::run::TimeoutRule;
use elbowroom_num::{End, Rational};
use elbowroom_plan::Side;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::{
    Best, Conditions, EnvelopeRequest, Inequalities, Timeline, UniformSlack, ValueOfInformation,
};
use crate::answers::{Exact, Version, ViolationAnswer, exact};
use crate::execute::as_text;

/// A robustness envelope, or the reason why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnvelopeAnswer {
    /// Format of the document.
    pub format: EnvelopeFormat,
    /// Version of the document.
    pub version: Version,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The name of the plan, as the request gives it.
    pub plan: String,
    /// The settings used.
    pub settings: EnvelopeSettings,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: EnvelopeFinding,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum EnvelopeFormat {
    /// The name `elbowroom-envelope`.
    #[default]
    #[serde(rename = "elbowroom-envelope")]
    Envelope,
}

/// Settings of the computation of an envelope.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnvelopeSettings {
    /// The algorithm of the search.
    pub method: Method,
    /// The guarantee inside the envelope.
    pub guarantee: Guarantee,
    /// Change of step sizes after a success.
    pub growth: Growth,
    /// Step size below which the search ended.
    #[serde(with = "exact")]
    pub precision: Rational,
    /// Alternative to `precision`: the precision of each parameter as a share of its nominal value.
    #[serde(
        with = "exact::option",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub relative_precision: Option<Rational>,
    /// The least separation of interfering happenings (ε).
    #[serde(with = "exact")]
    pub epsilon: Rational,
    /// `true` if ends were moved onto their limits.
    pub sharpen: bool,
    /// The rule that sets the time-out of each action: `10x,600` is 10 times the planned duration,
    /// at least 600; `none` in answers without this member.
    #[serde(with = "as_text", default = "off")]
    pub timeout: TimeoutRule,
}

fn off() -> TimeoutRule {
    TimeoutRule::Off
}

/// The result of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum EnvelopeFinding {
    /// There is an envelope.
    Envelope {
        /// The parameters, with their intervals and limits.
        parameters: Vec<LimitedRange>,
        /// Durations that the domain leaves to the executor, and that do not vary.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        chosen: Vec<ChosenDuration>,
        /// Reason for the end of the search.
        stop: Stop,
        /// The number of boxes checked.
        checks: usize,
        /// The time that the search took.
        seconds: f64,
        /// Each box found to be inside, in order.
        widenings: Vec<WideningStep>,
        /// Deviations of all quantities at once, if they are known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        balance: Option<UniformSlack>,
        /// The objective of the box, if the largest one was requested.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        best: Option<Best>,
        /// Counts of the plan's conditions, by the mechanism that enforces them.
        #[serde(default)]
        conditions: Conditions,
        /// The gain of knowing values in advance, if there is any.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        foresight: Option<ValueOfInformation>,
        /// The times of each action, as planned and anywhere in the envelope.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        timeline: Option<Timeline>,
        /// The inequalities that every schedule satisfies; only for plans that are not too large.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        inequalities: Option<Inequalities>,
        /// The makespan of the plan. Not in the document.
        #[serde(skip)]
        makespans: Option<Makespans>,
    },
    /// The plan fails even if everything goes as planned.
    Fails(NominalFailure),
    /// The given box lies inside the envelope.
    Inside {
        /// The parameters and their intervals.
        parameters: Vec<Range>,
    },
    /// The box lies outside, at least in part.
    Outside {
        /// The parameters and their intervals.
        parameters: Vec<Range>,
        /// A counterexample inside the box.
        counterexample: Counterexample,
    },
    /// The search ended before it found a box.
    None {
        /// Reason for the end of the search.
        stop: Stop,
    },
}

/// The reason why a plan fails even if nothing deviates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum NominalFailure {
    /// The validator rejects the plan as it is.
    Invalid {
        /// The reason.
        violation: ViolationAnswer,
    },
    /// The plan has no schedule, or a schedule that violates a condition.
    AsPlanned {
        /// The parameters.
        parameters: Vec<Quantity>,
        /// The counterexample.
        counterexample: Counterexample,
    },
}

/// A quantity that is left open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// The parameter's name, unique in the plan.
    pub name: String,
    /// The quantity in words: `duration of (drive rover depot shelf)`.
    pub quantity: String,
    /// Kind of the quantity.
    pub kind: QuantityKind,
    /// The action that the duration or number belongs to: `(drive rover depot shelf)`; `None` if
    /// there is no single action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    /// The value in the original plan.
    #[serde(with = "exact")]
    pub nominal: Rational,
    /// Weight of the quantity in the search.
    #[serde(with = "exact")]
    pub weight: Rational,
}

/// A quantity that is left open, and its interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// The quantity.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// The lower end.
    #[serde(with = "exact::lower")]
    pub lower: End,
    /// The upper end.
    #[serde(with = "exact::upper")]
    pub upper: End,
    /// The time-out of the action, if the quantity is a duration: it is cancelled if it has not ended
    /// by then; `None` if time-outs are off.
    #[serde(
        with = "exact::option",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub timeout: Option<Rational>,
}

/// A quantity that is left open, with its interval and the limits of the interval's ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitedRange {
    /// The quantity and its interval.
    #[serde(flatten)]
    pub range: Range,
    /// The reason why the lower end cannot move further, in words; `None` if there is none, or if
    /// it is not known.
    pub lower_limit: Option<String>,
    /// The reason why the upper end cannot move further.
    pub upper_limit: Option<String>,
}

/// A duration that the executor chooses when the action starts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChosenDuration {
    /// The label of the action's instance.
    pub instance: String,
    /// The action.
    pub action: String,
    /// Planned duration.
    pub duration: Exact,
    /// Its time-out; `None` if time-outs are off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout: Option<Exact>,
}

/// The kind of the quantity behind a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum QuantityKind {
    /// The duration of an action.
    Duration,
    /// A number in an action.
    Constant,
    /// A number of the domain.
    Domain,
    /// The value of a fluent at time 0.
    Initial,
    /// The time of timed initials.
    Timed,
    /// A bound between two time points of an STN plan file.
    Bound,
}

/// Reasons for the end of a search for an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stop {
    /// No end can be moved by the precision.
    #[serde(rename = "converged")]
    Converged,
    /// The limit on box checks was reached.
    #[serde(rename = "check limit")]
    CheckLimit,
    /// The watcher stopped the search at its time limit.
    #[serde(rename = "time limit")]
    TimeLimit,
    /// The watcher cancelled the search.
    #[serde(rename = "cancelled")]
    Cancelled,
    /// Some wider boxes are undecided: there are too many cases to distinguish.
    #[serde(rename = "too many cases")]
    Undecided,
}

/// A widening of the box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WideningStep {
    /// Time since the start of the search, in seconds.
    pub seconds: f64,
    /// Number of box checks before this widening.
    pub checks: usize,
    /// The name of the parameter whose interval has grown.
    pub parameter: String,
    /// The end that has moved, with its new value.
    #[serde(flatten)]
    pub end: MovedEnd,
}

/// An end of an interval that has moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "end", content = "value", rename_all = "lowercase")]
pub enum MovedEnd {
    /// The lower end.
    #[serde(with = "exact::lower")]
    Lower(End),
    /// The upper end.
    #[serde(with = "exact::upper")]
    Upper(End),
}

/// A violated requirement, with values and a schedule that violate it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Counterexample {
    /// The failure in words.
    pub message: String,
    /// Size of the violation, if it is a single number.
    #[serde(with = "exact::option")]
    pub shortfall: Option<Rational>,
    /// The validator's verdict on the schedule, if it was computed.
    pub verdict: Option<String>,
    /// The parameters' values, by name.
    pub values: IndexMap<String, Exact>,
    /// The time of each event; empty if there is no schedule for these values.
    pub schedule: Vec<ActionTimes>,
    /// Strategies of the world against two executors that learn some values too late: one that
    /// starts everything as early as possible, and one that starts everything as late as possible.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plays: Vec<String>,
}

/// The start and end times of an action in a schedule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionTimes {
    /// The label of the action's instance.
    pub instance: String,
    /// The action.
    pub action: String,
    /// The start time.
    pub start: Exact,
    /// The end time; `None` for an instantaneous action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<Exact>,
}

/// Makespans of the earliest schedules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Makespans {
    /// With all quantities at their nominal values.
    pub nominal: Rational,
    /// With all at their lower ends; `None` if one of these is infinite.
    pub at_lower: Option<Rational>,
    /// With all at their upper ends.
    pub at_upper: Option<Rational>,
}

/// A reason, and all ends that it limits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LimitGroup {
    /// The reason, in words.
    pub reason: String,
    /// The names of the parameters whose lower ends it limits.
    pub lower: Vec<String>,
    /// The same for upper ends.
    pub upper: Vec<String>,
}

impl EnvelopeAnswer {
    pub(super) fn new(request: &EnvelopeRequest, finding: EnvelopeFinding) -> Self {
        let problem = request.task.problem();
        let search = &request.search;
        Self {
            format: EnvelopeFormat::Envelope,
            version: Version,
            domain: problem.domain.clone(),
            problem: problem.name.clone(),
            plan: request.name.clone(),
            settings: EnvelopeSettings {
                method: request.method(),
                guarantee: request.guarantee,
                growth: search.growth,
                precision: search.precision.clone(),
                relative_precision: search.relative.clone(),
                epsilon: request.task.epsilon().clone(),
                sharpen: search.sharpen,
                timeout: request.timeout.clone(),
            },
            finding,
        }
    }

    /// Returns the limits of the envelope's ends, grouped by reason, by first occurrence; empty if
    /// there is no envelope.
    pub fn limits(&self) -> Vec<LimitGroup> {
        let EnvelopeFinding::Envelope { parameters, .. } = &self.finding else {
            return Vec::new();
        };
        let mut groups: IndexMap<&str, [Vec<String>; 2]> = IndexMap::new();
        for room in parameters {
            for (side, limit) in Side::BOTH
                .into_iter()
                .zip([&room.lower_limit, &room.upper_limit])
            {
                if let Some(reason) = limit {
                    let names = groups.entry(reason).or_default();
                    names[side.index()].push(room.range.quantity.name.clone());
                }
            }
        }
        let group = |(reason, [lower, upper]): (&str, [Vec<String>; 2])| LimitGroup {
            reason: reason.to_owned(),
            lower,
            upper,
        };
        groups.into_iter().map(group).collect()
    }
}
