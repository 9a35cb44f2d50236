//! Rates of facts that change by themselves, as an answer.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_learning::changes::{Changes, Exposure, Rate, learn};
use elbowroom_text::Source;
use serde::{Deserialize, Serialize};

use super::super::RequestError;
use super::{FactHistory, Log};

/// Rates at which the facts of a predicate become true, or false, by themselves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntChanges {
    /// The predicate: `open`.
    pub predicate: String,
    /// The new value of the facts.
    pub becomes: bool,
    /// The rate of all facts together.
    pub all: LearntRate,
    /// The rate of each fact, `(open office)`, if they differ significantly; otherwise empty.
    pub apart: Vec<(String, LearntRate)>,
}

/// A rate and the observations that it is based on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntRate {
    /// Number of observed changes.
    pub changes: u64,
    /// Total time for which the facts had the opposite value, in seconds.
    pub seconds: f64,
    /// Changes per second; `None` if that time is 0.
    pub per_second: Option<f64>,
    /// Garwood's 95 % interval of the rate.
    pub interval: Option<(f64, f64)>,
    /// Number of changes in this time according to the expected world file; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<f64>,
}

/// Expected numbers of changes by themselves in the logs.
#[derive(Debug)]
pub(super) struct ExpectedChanges {
    /// The predicates whose facts have rates.
    predicates: BTreeSet<String>,
    /// By fact and new value: the expected number of changes, and the seconds for which the fact
    /// had the opposite value.
    changes: BTreeMap<(String, bool), (f64, f64)>,
}

impl ExpectedChanges {
    /// Computes them from the rates of a world file, `[[hazard]]`.
    pub(super) fn new(logs: &[Log], world: &Source) -> Result<Self, RequestError> {
        let mut expected = Self {
            predicates: BTreeSet::new(),
            changes: BTreeMap::new(),
        };
        let courses = logs.iter().filter_map(|log| log.fact_history.as_ref());
        let mut is_compared = false;
        for course in courses {
            is_compared = true;
            for (exposure, rate) in course.expected(world)? {
                let predicate = predicate_of(&exposure.fact).to_owned();
                expected.predicates.insert(predicate);
                let key = (exposure.fact, exposure.becomes);
                let entry = expected.changes.entry(key).or_default();
                entry.0 += rate * exposure.seconds;
                entry.1 += exposure.seconds;
            }
        }
        if is_compared {
            return Ok(expected);
        }
        Err(RequestError::Unsupported(
            "no log records facts, so no comparison with the expected world is possible: give \
             traces of `elbowroom run --trace`; tables of attempts contain no facts"
                .to_owned(),
        ))
    }

    fn of(&self, fact: &str, becomes: bool) -> f64 {
        let found = self.changes.get(&(fact.to_owned(), becomes));
        found.map_or(0.0, |(changes, _)| *changes)
    }

    /// Returns the predicates with expected changes, but without observed ones.
    pub(super) fn unobserved(&self, seen: &[Changes]) -> Vec<LearntChanges> {
        let is_seen = |predicate: &str| seen.iter().any(|it| it.predicate == predicate);
        let unseen = self.predicates.iter().filter(|it| !is_seen(it));
        let both = unseen.flat_map(|predicate| [false, true].map(|becomes| (predicate, becomes)));
        let answers = both.map(|(predicate, becomes)| {
            let of_it = self
                .changes
                .iter()
                .filter(|((fact, truth), _)| *truth == becomes && predicate_of(fact) == predicate);
            let (changes, seconds) = of_it.fold((0.0, 0.0), |sum, (_, (changes, seconds))| {
                (sum.0 + changes, sum.1 + seconds)
            });
            let rate = Rate {
                changes: 0,
                seconds,
            };
            LearntChanges {
                predicate: predicate.clone(),
                becomes,
                all: LearntRate::of(rate, Some(changes)),
                apart: Vec::new(),
            }
        });
        let is_expected = |answer: &LearntChanges| answer.all.expected > Some(0.0);
        answers.filter(is_expected).collect()
    }
}

/// Returns the predicate of a fact: `open` for `(open office)`.
fn predicate_of(fact: &str) -> &str {
    let name = fact.trim_matches(['(', ')']);
    name.split_whitespace().next().unwrap_or_default()
}

/// Learns rates from all logs that have a course, for predicates with a fact that has changed by
/// itself.
pub(super) fn of(logs: &[Log]) -> Vec<Changes> {
    let courses = || logs.iter().filter_map(|log| log.fact_history.as_ref());
    let predicates: BTreeSet<String> = courses()
        .flat_map(FactHistory::changing_predicates)
        .collect();
    let exposures: Vec<Exposure> = predicates
        .iter()
        .flat_map(|predicate| courses().flat_map(|course| course.exposures(predicate)))
        .collect();
    learn(&exposures)
}

impl LearntChanges {
    pub(super) fn of(changes: &Changes, expected: Option<&ExpectedChanges>) -> Self {
        let of_fact = |fact: &str| expected.map(|expected| expected.of(fact, changes.becomes));
        let facts = || changes.facts.iter();
        Self {
            predicate: changes.predicate.clone(),
            becomes: changes.becomes,
            all: LearntRate::of(
                changes.all,
                expected.map(|_| facts().filter_map(|(fact, _)| of_fact(fact)).sum()),
            ),
            apart: facts()
                .filter(|_| changes.has_rate_per_fact)
                .map(|(fact, rate)| (fact.clone(), LearntRate::of(*rate, of_fact(fact))))
                .collect(),
        }
    }
}

impl LearntRate {
    fn of(rate: Rate, expected: Option<f64>) -> Self {
        Self {
            expected,
            changes: rate.changes,
            seconds: rate.seconds,
            per_second: rate.per_second(),
            interval: rate.interval(),
        }
    }
}
