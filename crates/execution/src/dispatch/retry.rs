//! Retries of failed starts.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId};

use super::Dispatch;
use crate::reason::Subject;

/// A start that has failed.
#[derive(Clone, Debug)]
pub(super) struct Retry {
    /// The time at which it may be tried again, on the plan's clock.
    pub(super) not_before: Rational,
    /// Number of failures in a row.
    pub(super) failures: u32,
}

/// Number of failures in a row after which the wait does not grow any more: ε · 2⁴⁰ is 35 years.
const MAX_DOUBLINGS: u32 = 40;

impl Dispatch {
    /// Makes a failed start ready again, ε after its first failure; the wait doubles with each
    /// further failure in a row. So a start that always fails is tried a few dozen times in the
    /// longest of runs, and one that fails occasionally loses almost no time.
    pub(crate) fn schedule_retry(&mut self, id: InstanceId, failed: &Rational) {
        let [start, _] = self.start_and_end_nodes(id);
        let known = self.retries.get(&start);
        let failures = known.map_or(0, |retry| retry.failures) + 1;
        let doublings = (failures - 1).min(MAX_DOUBLINGS);
        let wait = &self.epsilon * Rational::from(1_i64 << doublings);
        let retry = Retry {
            not_before: self.to_plan_time(failed) + wait,
            failures,
        };
        self.retries.insert(start, retry);
        self.progress.running.remove(&id);
        self.progress.ready.insert(start);
    }

    /// Returns the time at which a failed start may be retried.
    pub(super) fn retry_time(&self, start: NodeId) -> Option<Rational> {
        self.retries
            .get(&start)
            .map(|retry| retry.not_before.clone())
    }

    /// Returns the number of failures in a row of a start; `of` describes the start if it is still
    /// to come.
    pub(super) fn failure_subject(&self, start: NodeId, of: Option<String>) -> Option<Subject> {
        let failures = self.retries.get(&start)?.failures;
        Some(Subject::Retry { of, failures })
    }
}
