//! How often facts change by themselves, as an answer.

use std::collections::BTreeSet;

use elbowroom_learning::changes::{Changes, Exposure, Rate, learn};
use serde::{Deserialize, Serialize};

use super::{Course, Log};

/// How often the facts of a predicate become true, or false, by themselves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangesLearnt {
    /// The predicate: `open`.
    pub predicate: String,
    /// What its facts become.
    pub becomes: bool,
    /// All of them together.
    pub all: RateLearnt,
    /// Each fact by itself, `(open office)`, where they differ more than chance explains; otherwise
    /// none.
    pub apart: Vec<(String, RateLearnt)>,
}

/// A rate, and on what it rests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RateLearnt {
    /// How often that was seen.
    pub changes: u64,
    /// For how many seconds facts were the opposite, all together.
    pub seconds: f64,
    /// How often it comes about per second; `None` where there was no time.
    pub per_second: Option<f64>,
    /// Garwood's 95 % interval of that.
    pub interval: Option<(f64, f64)>,
}

/// What all logs say that have a course.
pub(super) fn of(logs: &[Log]) -> Vec<Changes> {
    let courses = || logs.iter().filter_map(|log| log.course.as_ref());
    let predicates: BTreeSet<String> = courses().flat_map(Course::changing).collect();
    let exposures: Vec<Exposure> = predicates
        .iter()
        .flat_map(|predicate| courses().flat_map(|course| course.exposures(predicate)))
        .collect();
    learn(&exposures)
}

impl ChangesLearnt {
    pub(super) fn of(changes: &Changes) -> Self {
        let facts = changes.facts.iter().filter(|_| changes.is_apart);
        Self {
            predicate: changes.predicate.clone(),
            becomes: changes.becomes,
            all: RateLearnt::of(changes.all),
            apart: facts
                .map(|(fact, rate)| (fact.clone(), RateLearnt::of(*rate)))
                .collect(),
        }
    }
}

impl RateLearnt {
    fn of(rate: Rate) -> Self {
        Self {
            changes: rate.changes,
            seconds: rate.seconds,
            per_second: rate.per_second(),
            interval: rate.interval(),
        }
    }
}
