//! The answer about a network as a document: `docs/reference/formats/network.md`.

use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use super::simulate::Durations;

pub(super) const FORMAT: &str = "elbowroom-network-answer";
pub(super) const VERSION: u32 = 1;

/// The analysis of a temporal network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The name of the document, `elbowroom-network-answer`.
    pub format: String,
    /// The version of the document, 1.
    pub version: u32,
    /// The network's own name; empty if it has none.
    pub name: String,
    /// The format of the file.
    pub read_as: String,
    /// Number of time points.
    pub points: usize,
    /// Number of requirements `to - from <= bound`.
    pub requirements: usize,
    /// Number of contingent links.
    pub links: usize,
    /// Remarks on parts of the file that were interpreted leniently, or left out.
    pub remarks: Vec<String>,
    /// Consistency: there is a schedule for some durations of the links.
    pub consistent: ControllabilityCheck,
    /// Weak controllability: there is a schedule for all durations of the links. `None` for
    /// networks without links.
    pub weak: Option<ControllabilityCheck>,
    /// Dynamic controllability: an executor that observes durations as they occur can always find a
    /// schedule. `None` for networks without links.
    pub dynamic: Option<ControllabilityCheck>,
    /// Strong controllability: a single schedule works for all durations of the links. `None` for
    /// networks without links.
    pub strong: Option<ControllabilityCheck>,
    /// Most probable box of durations that makes the network dynamically controllable, if it was
    /// requested and exists. `None` if the network is controllable for all its durations.
    pub best: Option<ControllableBox>,
    /// Success rate of simulated dispatch.
    pub simulation: Option<Simulated>,
}

impl Answer {
    /// Returns `true` if the network can be executed: it is dynamically controllable or, without
    /// links, consistent.
    pub fn is_executable(&self) -> bool {
        let promise = self.dynamic.as_ref().unwrap_or(&self.consistent);
        promise.verdict == Verdict::Yes
    }
}

/// The result of a controllability check: yes, no or undecided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The property holds.
    Yes,
    /// The property does not hold.
    No,
    /// The limit on branches was reached before a result.
    Undecided,
}

/// The result of a controllability check, with the conflict if it fails.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllabilityCheck {
    /// The result.
    pub verdict: Verdict,
    /// The conflict, if the property does not hold.
    pub reason: Option<Reason>,
    /// For strong controllability, the times of the points that the executor chooses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub schedule: Vec<Time>,
    /// For an undecided property, the number of examined branches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub branches: Option<usize>,
}

impl ControllabilityCheck {
    pub(super) fn yes() -> Self {
        Self {
            verdict: Verdict::Yes,
            reason: None,
            schedule: Vec::new(),
            branches: None,
        }
    }

    pub(super) fn no(reason: Reason) -> Self {
        Self {
            verdict: Verdict::No,
            reason: Some(reason),
            ..Self::yes()
        }
    }
}

/// A conflict: the constraints that contradict each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// Size of the conflict, a positive number; `inf` if it is unbounded.
    pub by: Number,
    /// The bounds of the cycle, in its order.
    pub steps: Vec<Step>,
    /// `true` if `steps` contains the whole cycle.
    pub is_whole: bool,
    /// The links of the conflict, each with the end of its interval.
    pub durations: Vec<LinkDuration>,
}

/// One bound of a reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// `requirement`, `early` or `late` (the earliest or the latest end of a link), or `duration`
    /// (a duration of a link).
    pub given: String,
    /// The bound in words.
    pub words: String,
}

/// The duration of a contingent link in a conflict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkDuration {
    /// The activation point of the link.
    pub activation: String,
    /// The point that the world chooses.
    pub end: String,
    /// `lower` or `upper` for an end of the interval; `within` for a value between.
    pub at: String,
    /// The duration.
    pub value: Number,
}

/// The time of a time point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// The time point.
    pub point: String,
    /// The time.
    pub time: Number,
}

/// Box of durations that makes a network dynamically controllable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllableBox {
    /// Lower bound on the probability of success, whatever the dependence between the durations:
    /// one minus the sum of the risks of all links.
    pub least: f64,
    /// Lower bound on the probability of success if only the durations of a group of correlated
    /// links depend on each other.
    pub given: f64,
    /// The intervals of the links.
    pub links: Vec<LinkInterval>,
    /// Number of exact checks of controllability in the search.
    pub checks: usize,
}

/// Interval of durations of a contingent link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkInterval {
    /// The activation point of the link.
    pub activation: String,
    /// The point that the world chooses.
    pub end: String,
    /// The least duration.
    pub lower: Number,
    /// The greatest duration.
    pub upper: Number,
    /// Probability of a duration in the interval.
    pub probability: f64,
}

/// A number as an exact text and as the nearest float.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// A whole number, `p/q`, or `inf`.
    pub exact: String,
    /// The nearest float; `None` for infinity.
    pub decimal: Option<f64>,
}

impl Number {
    /// Returns infinity.
    pub fn infinite() -> Self {
        Self {
            exact: "inf".to_owned(),
            decimal: None,
        }
    }

    /// Formats it in short decimals, for users.
    pub fn short(&self) -> String {
        let number = self.exact.parse::<Rational>();
        number.map_or_else(|_| self.exact.clone(), |it| elbowroom_network::decimal(&it))
    }
}

impl From<&Rational> for Number {
    fn from(number: &Rational) -> Self {
        Self {
            exact: number.to_string(),
            decimal: Some(number.to_f64()),
        }
    }
}

/// The success rate of simulated dispatch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simulated {
    /// The number of runs.
    pub runs: u64,
    /// The number of runs that satisfied all requirements.
    pub successes: u64,
    /// The share of these runs.
    pub share: f64,
    /// The 95 % confidence interval of the success probability (Wilson 1927).
    pub interval: [f64; 2],
    /// The random seed.
    pub seed: u64,
    /// Distribution of the durations.
    pub durations: Durations,
    /// `dispatchable` (by the dispatchable network), `best-box` (by the dispatchable network for the
    /// durations of the most probable box) or `early-first` (as early as the windows allow, as if
    /// the executor could choose the ends of links).
    pub executor: String,
    /// The number of runs with a duration outside the bounds of its link.
    pub outside: u64,
    /// The requirements that were violated most often.
    pub broken: Vec<ViolatedRequirement>,
}

/// A violated requirement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ViolatedRequirement {
    /// The requirement in words.
    pub requirement: String,
    /// The number of runs that violated it.
    pub runs: u64,
}
