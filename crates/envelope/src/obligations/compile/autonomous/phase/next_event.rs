//! The time of the next transition: an event, or the start or stop of a process.

use std::collections::BTreeSet;

use elbowroom_model::ground::Condition;
use elbowroom_num::Rational;

use super::super::condition::{ReadTime, StateView};
use super::Phase;
use crate::linear::Linear;
use crate::obligations::Refusal;

impl Phase<'_> {
    /// Returns the time of the next transition before `until`: an event's condition becomes true,
    /// or a process starts or stops, in the nominal schedule.
    pub(super) fn next_transition(&self, until: &Linear) -> Result<Option<Linear>, Refusal> {
        let view = self.view(&self.now);
        let length = view.nominal_value(until) - view.nominal_value(&self.at);
        let autonomous = self.autonomous_of_task();
        let events = autonomous.events.iter();
        let events = events.map(|event| (&event.snap.condition, None));
        let processes = autonomous.processes.iter().zip(&self.is_active);
        let processes = processes.map(|(process, on)| (&process.condition, Some(*on)));
        let conditions: Vec<(&Condition, Option<bool>)> = events.chain(processes).collect();
        let mut moments = BTreeSet::new();
        for (condition, _) in &conditions {
            let zeros = crossing_times(&view, condition)?;
            moments.extend(zeros.into_iter().map(|(elapsed, _)| elapsed));
        }
        let moments = moments.into_iter();
        for elapsed in moments.filter(|at| at.is_positive() && *at <= length) {
            let mut turned = Vec::new();
            for (condition, at_work) in &conditions {
                let is_then = view.holds(condition, ReadTime::At(&elapsed))?;
                let is_after = view.holds(condition, ReadTime::RightAfter(&elapsed))?;
                // On arrival at the next happening, the state right after it is not known yet.
                let is_turned = match at_work {
                    None if elapsed == length => is_then,
                    None => is_then || is_after,
                    Some(_) if elapsed == length => false,
                    Some(on) => is_then != *on || is_after != *on,
                };
                if is_turned {
                    turned.push(*condition);
                }
            }
            if !turned.is_empty() {
                return self.transition_time(&view, &turned, &elapsed).map(Some);
            }
        }
        Ok(None)
    }

    /// Returns the moment, nominally `elapsed` from now, at which these conditions change.
    fn transition_time(
        &self,
        view: &StateView<'_>,
        turned: &[&Condition],
        elapsed: &Rational,
    ) -> Result<Linear, Refusal> {
        let mut found: Option<Linear> = None;
        for condition in turned {
            for (zero, later) in crossing_times(view, condition)? {
                if zero != *elapsed {
                    continue;
                }
                let Some(later) = later else {
                    return Err(self.obstacle(
                        "the rate at which a number reaches the bound of a condition depends on \
                         parameters",
                    ));
                };
                let moment = self.at.plus(&later);
                if found.as_ref().is_some_and(|other| *other != moment) {
                    return Err(self.obstacle(
                        "two numbers reach bounds at the same time in the nominal schedule, but \
                         not in all schedules: their order is unknown",
                    ));
                }
                found = Some(moment);
            }
        }
        found.ok_or_else(|| {
            self.obstacle(
                "the time of an event, or of a start or stop of a \
                                           process, is unknown",
            )
        })
    }
}

/// Returns the times from now at which the numbers of a condition reach its bounds in the nominal
/// schedule and, if known, in all schedules.
pub(super) fn crossing_times(
    view: &StateView<'_>,
    condition: &Condition,
) -> Result<Vec<(Rational, Option<Linear>)>, Refusal> {
    let mut sides = Vec::new();
    condition.visit_comparisons(&mut |left, right| sides.push((left.clone(), right.clone())));
    let mut zeros = Vec::new();
    for (left, right) in &sides {
        let moving = match view.difference(left, right) {
            Ok(moving) => moving,
            // An undefined or non-linear number is harmless if a fact decides the condition.
            Err(_) if is_decided_by_facts(view, condition)? => continue,
            Err(refusal) => return Err(refusal),
        };
        let rate = view.nominal_value(&moving.rate);
        let Some(per_rate) = rate.reciprocal() else {
            continue;
        };
        let elapsed = -(view.nominal_value(&moving.value) * &per_rate);
        let constant = moving.rate.as_constant();
        let later = constant.map(|_| moving.value.scaled(&-per_rate));
        zeros.push((elapsed, later));
    }
    Ok(zeros)
}

/// Returns `true` if a conjunction is false because of a fact.
fn is_decided_by_facts(view: &StateView<'_>, condition: &Condition) -> Result<bool, Refusal> {
    for conjunct in condition.conjuncts() {
        let mut has_numbers = false;
        conjunct.visit_comparisons(&mut |_, _| has_numbers = true);
        if !has_numbers && !view.holds(conjunct, ReadTime::At(&Rational::ZERO))? {
            return Ok(true);
        }
    }
    Ok(false)
}
