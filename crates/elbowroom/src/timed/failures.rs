//! Failures of actions, and their outcomes.

use elbowroom_sim::{Becoming, Failing, Failure, Outcome, WorldModel};

use super::NotTabulated;
use super::act::{Act, Snap};
use super::compile::Compiler;
use super::world::Facts;

/// An outcome of a failure.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Failed {
    /// Conditional probability of this outcome, given that the action fails.
    pub(crate) share: f64,
    /// The added facts, without deleted ones.
    pub(crate) adds: Facts,
    pub(crate) deletes: Facts,
    /// Time for which the failed action is still running and cannot be cancelled, in seconds.
    pub(crate) delay: f64,
}

/// The end of an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Ending {
    /// Success, with this draw of the amounts.
    Well(u16),
    /// Failure, with this outcome.
    Badly(u8),
}

impl Failed {
    pub(super) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }
}

impl Act {
    /// Returns all facts that a failure may make true.
    pub(super) fn adds_by_failing(&self) -> Facts {
        let failures = self.failures.iter();
        failures.fold(0, |all, failed| all | failed.adds)
    }

    /// Returns all facts that a failure may make false.
    pub(super) fn deletes_by_failing(&self) -> Facts {
        let failures = self.failures.iter();
        failures.fold(0, |all, failed| all | failed.deletes)
    }

    /// Returns the outcome of the failure, if it is one.
    pub(super) fn failed(&self, ending: Ending) -> Option<&Failed> {
        match ending {
            Ending::Well(_) => None,
            Ending::Badly(way) => self.failures.get(usize::from(way)),
        }
    }

    /// Returns `true` if it may have failed already while it is still running, so that it cannot be
    /// cancelled.
    pub(super) fn may_hold_up(&self) -> bool {
        self.failures.iter().any(|failed| failed.delay > 0.0)
    }
}

/// Maximum number of outcomes of an action's failures.
const MOST_WAYS: usize = 64;

impl Compiler<'_> {
    /// Returns the distinct outcomes of an action's failures.
    pub(super) fn failures(
        &self,
        name: &str,
        model: &WorldModel,
        start: &Snap,
        takes_time: bool,
    ) -> Result<Vec<Failed>, NotTabulated> {
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        let mut ways: Vec<Failed> = Vec::new();
        let Some(failing) = model.failing(name) else {
            return Ok(ways);
        };
        let is_at_start = failing.when == Failure::AtStart || !takes_time;
        if is_at_start && !failing.outcomes.is_empty() {
            return refuse("a start that fails with outcomes");
        }
        let mut rest = 1.0;
        for outcome in &failing.outcomes {
            if !outcome.is_reported {
                return refuse("failures with outcomes that are not reported");
            }
            let Some((adds, deletes)) = self.left(name, failing, Some(outcome), start) else {
                return refuse("failures with outcomes that change numbers");
            };
            rest -= outcome.probability;
            let delay = outcome.delay.to_f64();
            add(&mut ways, outcome.probability, (adds, deletes), delay);
        }
        let undone = self.left(name, failing, None, start);
        // Decimal fractions may not add up to exactly 1 in binary.
        if rest > 1e-9 {
            add(&mut ways, rest, undone.unwrap_or_default(), 0.0);
        }
        if ways.len() > MOST_WAYS {
            return refuse(&format!(
                "{} different outcomes of its failures, and {MOST_WAYS} is the most",
                ways.len()
            ));
        }
        let sum: f64 = ways.iter().map(|way| way.share).sum();
        for way in &mut ways {
            way.share /= sum;
        }
        Ok(ways)
    }

    /// Returns the facts that a failure makes true and false; `None` if it changes numbers.
    fn left(
        &self,
        name: &str,
        failing: &Failing,
        outcome: Option<&Outcome>,
        start: &Snap,
    ) -> Option<(Facts, Facts)> {
        let (mut adds, mut deletes) = if failing.is_undone {
            (start.deletes & !start.adds, start.adds)
        } else {
            (0, 0)
        };
        for change in outcome.iter().flat_map(|outcome| &outcome.changes) {
            let Becoming::Truth(truth) = change.becomes else {
                return None;
            };
            let fact = self.task.fact_named(&change.what.of(name));
            let bit = fact.map_or(0, |fact| self.bit(fact));
            (adds, deletes) = if truth {
                (adds | bit, deletes & !bit)
            } else {
                (adds & !bit, deletes | bit)
            };
        }
        Some((adds, deletes))
    }
}

fn add(ways: &mut Vec<Failed>, share: f64, (adds, deletes): (Facts, Facts), delay: f64) {
    if share <= 0.0 {
        return;
    }
    let is_same = |way: &&mut Failed| {
        (way.adds, way.deletes, way.delay.to_bits()) == (adds, deletes, delay.to_bits())
    };
    match ways.iter_mut().find(is_same) {
        Some(way) => way.share += share,
        None => ways.push(Failed {
            share,
            adds,
            deletes,
            delay,
        }),
    }
}
