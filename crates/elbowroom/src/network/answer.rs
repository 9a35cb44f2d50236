//! What there is to say about a network, for programs: `docs/formats/network.md`.

use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use super::simulate::Durations;

pub(super) const FORMAT: &str = "elbowroom-network-answer";
pub(super) const VERSION: u32 = 1;

/// The analysis of a temporal network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// `elbowroom-network-answer`.
    pub format: String,
    /// 1.
    pub version: u32,
    /// The network's own name; empty if it has none.
    pub name: String,
    /// In which format it was read.
    pub read_as: String,
    /// How many time points it has.
    pub points: usize,
    /// How many requirements `to - from <= bound`.
    pub requirements: usize,
    /// How many contingent links.
    pub links: usize,
    /// Remarks on parts of the file that were interpreted leniently, or left out.
    pub remarks: Vec<String>,
    /// Whether there is a schedule, if the world is kind.
    pub consistent: Promise,
    /// Whether there is one for whatever the world does. Not for networks without links.
    pub weak: Option<Promise>,
    /// Whether an executor can be sure to find one as it goes.
    pub dynamic: Option<Promise>,
    /// Whether one fits all.
    pub strong: Option<Promise>,
    /// How often dispatch succeeds.
    pub simulation: Option<Simulated>,
}

impl Answer {
    /// Whether the network can be executed: it is dynamically controllable or, without links,
    /// consistent.
    pub fn is_executable(&self) -> bool {
        let promise = self.dynamic.as_ref().unwrap_or(&self.consistent);
        promise.verdict == Verdict::Yes
    }
}

/// The result of a controllability check: yes, no or undecided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It can.
    Yes,
    /// It cannot.
    No,
    /// The limit on branches was reached before that was known.
    Undecided,
}

/// The result of a controllability check, with the conflict if it fails.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Promise {
    /// Whether.
    pub verdict: Verdict,
    /// Why not.
    pub reason: Option<Reason>,
    /// Strong controllability: when the points happen that the executor chooses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub schedule: Vec<Time>,
    /// Undecided: how many branches were looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub branches: Option<usize>,
}

impl Promise {
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
    /// By how much the steps contradict each other: a positive number; `inf` if there is no limit
    /// to it.
    pub by: Number,
    /// The bounds in the order of a cycle.
    pub steps: Vec<Step>,
    /// Whether `steps` has all of the cycle.
    pub is_whole: bool,
    /// The links that matter, and at which end each is taken.
    pub durations: Vec<LinkDuration>,
}

/// One bound of a reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// `requirement`, `early` or `late` (the end of a link may come so early, or so late), or
    /// `duration` (a link takes so long).
    pub given: String,
    /// In words.
    pub words: String,
}

/// The duration of a contingent link in a conflict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkDuration {
    /// The point from which the link counts.
    pub activation: String,
    /// The point that the world chooses.
    pub end: String,
    /// `lower` or `upper`; `within` where it lies between.
    pub at: String,
    /// The duration.
    pub value: Number,
}

/// The time of a time point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// The point.
    pub point: String,
    /// The time.
    pub time: Number,
}

/// A number as an exact text and, beside it, as the nearest float.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// A whole number, `p/q`, or `inf`.
    pub exact: String,
    /// The nearest float; `None` of infinity.
    pub decimal: Option<f64>,
}

impl Number {
    /// More than any number.
    pub fn infinite() -> Self {
        Self {
            exact: "inf".to_owned(),
            decimal: None,
        }
    }

    /// In short decimals, for people.
    pub fn short(&self) -> String {
        let number = self.exact.parse::<Rational>();
        number.map_or_else(|_| self.exact.clone(), |it| elbowroom_network::number(&it))
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
    /// In how many all requirements held.
    pub successes: u64,
    /// In which share.
    pub share: f64,
    /// The 95 % confidence interval for it (Wilson 1927).
    pub interval: [f64; 2],
    /// The seed.
    pub seed: u64,
    /// How durations were drawn.
    pub durations: Durations,
    /// `dispatchable` (by the dispatchable network) or `early-first` (as early as the windows
    /// allow, as if the ends of links could be chosen).
    pub executor: String,
    /// In how many runs a duration lay outside the bounds of its link.
    pub outside: u64,
    /// The requirements that were broken most often.
    pub broken: Vec<Broken>,
}

/// A requirement that did not hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Broken {
    /// The requirement in words.
    pub requirement: String,
    /// In how many runs.
    pub runs: u64,
}
