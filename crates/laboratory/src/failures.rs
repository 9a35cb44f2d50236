//! Failures of trials by verdict, cause and action, each with its first trial.

use elbowroom_execution::run::{Report, Verdict};
use serde::{Deserialize, Serialize};

/// Failed runs of one kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// Verdict of the runs.
    pub verdict: String,
    /// Cause for which the last plan was abandoned; `None` if none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
    /// Action of that cause.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    /// Number of runs.
    pub runs: u64,
    /// First of the runs.
    pub first: TrialId,
}

/// Trial of an executor in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialId {
    /// Position of the problem, from 0.
    pub problem: usize,
    /// Number of its trial, from 0.
    pub trial: u64,
}

/// Failed runs of a cell by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Failures(Vec<Failure>);

impl Failures {
    /// Returns all kinds, the most frequent first.
    pub fn kinds(&self) -> Vec<&Failure> {
        let mut kinds: Vec<&Failure> = self.0.iter().collect();
        kinds.sort_by(|a, b| b.runs.cmp(&a.runs).then_with(|| a.key().cmp(&b.key())));
        kinds
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Counts a run.
    pub(crate) fn count(&mut self, report: &Report, first: TrialId) {
        if report.verdict == Verdict::GoalReached {
            return;
        }
        // The reason why no plan is left says more than the reason why the last one was abandoned.
        let reason = report.dead_end.last().or(report.reasons.last());
        self.add(&Failure {
            verdict: report.verdict.name().to_owned(),
            cause: reason.map(|reason| reason.cause.name().to_owned()),
            action: reason.and_then(|reason| reason.action.clone()),
            runs: 1,
            first,
        });
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for failure in &other.0 {
            self.add(failure);
        }
    }

    /// Adds failures of one kind. Kinds are sorted, so the list does not depend on the order of the
    /// runs.
    pub(crate) fn add(&mut self, failure: &Failure) {
        match self.0.binary_search_by(|own| own.key().cmp(&failure.key())) {
            Ok(place) => {
                let own = &mut self.0[place];
                own.runs += failure.runs;
                own.first = own.first.min(failure.first);
            }
            Err(place) => self.0.insert(place, failure.clone()),
        }
    }
}

impl Failure {
    fn key(&self) -> (&str, Option<&str>, Option<&str>) {
        (&self.verdict, self.cause.as_deref(), self.action.as_deref())
    }
}
