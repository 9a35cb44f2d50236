//! How trials fail: by verdict, cause and action, each with its first trial, and that trial's trace.

use elbowroom_execution::run::{Report, Verdict};
use serde::{Deserialize, Serialize};

/// Failed runs of one kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// How they ended.
    pub verdict: String,
    /// Why the last plan was given up; `None` if none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
    /// The action that this was about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    /// The number of runs.
    pub runs: u64,
    /// The first of them.
    pub first: TrialId,
}

/// A trial of an executor in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialId {
    /// Which problem, from 0.
    pub problem: usize,
    /// Which trial of it, from 0.
    pub trial: u64,
}

/// The failed runs of a cell by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Failures(Vec<Failure>);

impl Failures {
    /// All kinds, the most frequent first.
    pub fn kinds(&self) -> Vec<&Failure> {
        let mut kinds: Vec<&Failure> = self.0.iter().collect();
        kinds.sort_by(|a, b| b.runs.cmp(&a.runs).then_with(|| a.key().cmp(&b.key())));
        kinds
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// One more run.
    pub(super) fn count(&mut self, report: &Report, first: TrialId) {
        if report.verdict == Verdict::GoalReached {
            return;
        }
        // Where no plan is left, that says more than why the last one was given up.
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

    /// Kinds are kept in order, so that the same runs give the same list whoever counts them.
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
