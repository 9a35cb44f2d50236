//! Compilation of the outcomes of failures.

use elbowroom_sim::{FactOutcome, FailureRule, FailureTime, Outcome, WorldModel};

use super::action_model::{Facts, FailureKind, Snap};
use super::compile::Compiler;
use crate::settings::NotTabulated;

/// Maximum number of outcomes of an action's failures.
const MAX_WAYS: usize = 64;

impl Compiler<'_> {
    /// Returns the distinct outcomes of an action's failures.
    pub(crate) fn failures(
        &self,
        name: &str,
        model: &WorldModel,
        start: &Snap,
        takes_time: bool,
    ) -> Result<Vec<FailureKind>, NotTabulated> {
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        let mut ways: Vec<FailureKind> = Vec::new();
        let Some(failing) = model.failure_rule(name) else {
            return Ok(ways);
        };
        let is_at_start = failing.when == FailureTime::AtStart || !takes_time;
        if is_at_start && !failing.outcomes.is_empty() {
            return refuse("a start that fails with outcomes");
        }
        let mut rest = 1.0;
        for outcome in &failing.outcomes {
            if !outcome.is_reported {
                return refuse("failures with outcomes that are not reported");
            }
            let Some((adds, deletes)) =
                self.facts_after_failure(name, failing, Some(outcome), start)
            else {
                return refuse("failures with outcomes that change numbers");
            };
            rest -= outcome.probability;
            let delay = outcome.delay.to_f64();
            add(&mut ways, outcome.probability, (adds, deletes), delay);
        }
        let undone = self.facts_after_failure(name, failing, None, start);
        // Decimal fractions may not add up to exactly 1 in binary.
        if rest > 1e-9 {
            add(&mut ways, rest, undone.unwrap_or_default(), 0.0);
        }
        if ways.len() > MAX_WAYS {
            return refuse(&format!(
                "{} different outcomes of its failures, more than the limit of {MAX_WAYS}",
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
    fn facts_after_failure(
        &self,
        name: &str,
        failing: &FailureRule,
        outcome: Option<&Outcome>,
        start: &Snap,
    ) -> Option<(Facts, Facts)> {
        let (mut adds, mut deletes) = if failing.is_undone {
            (start.deletes & !start.adds, start.adds)
        } else {
            (0, 0)
        };
        for change in outcome.iter().flat_map(|outcome| &outcome.changes) {
            let FactOutcome::Truth(truth) = change.change else {
                return None;
            };
            let fact = self.task.fact_named(&change.target.instantiate(name));
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

fn add(ways: &mut Vec<FailureKind>, share: f64, (adds, deletes): (Facts, Facts), delay: f64) {
    if share <= 0.0 {
        return;
    }
    let is_same = |way: &&mut FailureKind| {
        (way.adds, way.deletes, way.delay.to_bits()) == (adds, deletes, delay.to_bits())
    };
    match ways.iter_mut().find(is_same) {
        Some(way) => way.share += share,
        None => ways.push(FailureKind {
            share,
            adds,
            deletes,
            delay,
        }),
    }
}
