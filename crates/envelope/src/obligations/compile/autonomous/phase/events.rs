//! Execution of events.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Change, Expression, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::super::condition::ReadTime;
use super::{Occurrence, Phase};
use crate::linear::Linear;
use crate::obligations::{Inequality, Refusal};

impl Phase<'_> {
    /// Executes some events simultaneously, all in the same state; right after the moment, or at
    /// it.
    pub(super) fn execute_simultaneously(
        &mut self,
        ready: &[usize],
        is_after: bool,
    ) -> Result<(), Refusal> {
        let events = &self.autonomous_of_task().events;
        for (position, &event) in ready.iter().enumerate() {
            let name = &events[event].name;
            if !self.fired.insert(event) {
                return Err(self.obstacle(&format!("the event {name} happens infinitely often")));
            }
            let own = &self.autonomous.footprints[event];
            let mut others = ready[..position].iter();
            if others.any(|other| own.interferes_with(&self.autonomous.footprints[*other])) {
                return Err(self.obstacle(&format!(
                    "the event {name} happens together with another event, and they interfere"
                )));
            }
            self.require_single_occurrence(event);
            self.occurred.push(Occurrence {
                event,
                after: self.node,
                at: self.at.clone(),
            });
        }
        let mut then = self.now.clone();
        let (mut added, mut updated) = (Vec::new(), BTreeMap::new());
        for effect in ready.iter().flat_map(|&event| &events[event].snap.effects) {
            let guard = &effect.guard.now;
            self.refuse_derived_numbers(guard, "a conditional effect of an event")?;
            let mut has_numbers = false;
            guard.visit_comparisons(&mut |_, _| has_numbers = true);
            if is_after && has_numbers {
                return Err(self.obstacle(
                    "a conditional effect of an event that happens right after a moment compares \
                     numbers",
                ));
            }
            let holds = self
                .view(&self.now)
                .holds(guard, ReadTime::At(&Rational::ZERO))?;
            let course = "the condition of a conditional effect of an event must keep its truth \
                          value";
            self.require_now(guard, holds, course)?;
            if !holds {
                continue;
            }
            match &effect.change {
                Change::Add(fact) => added.push(*fact),
                Change::Delete(fact) => {
                    self.facts.insert(*fact);
                    then.put_fact(*fact, false);
                }
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => {
                    let old = match updated.get(fluent) {
                        Some(_) if !operator.is_additive() => {
                            return Err(self.obstacle("events change a number in several ways"));
                        }
                        Some(old) => Some(Linear::clone(old)),
                        None => None,
                    };
                    let new = self.updated(*operator, *fluent, old, value)?;
                    updated.insert(*fluent, new);
                }
            }
        }
        for fact in added {
            self.facts.insert(fact);
            then.put_fact(fact, true);
        }
        for (fluent, value) in updated {
            self.fluents.insert(fluent);
            then.put_value(fluent, Some(value));
        }
        self.now = then;
        Ok(())
    }

    /// Requires that an event happens only once at one moment, either on arrival at a happening or
    /// because of it.
    fn require_single_occurrence(&mut self, event: usize) {
        if self.has_elapsed() {
            return;
        }
        let mut earlier = self.earlier.iter().filter(|earlier| earlier.event == event);
        let Some(last) = earlier.next_back() else {
            return;
        };
        let broken = Inequality {
            expression: self.at.minus(&last.at),
            is_strict: false,
        };
        let name = &self.autonomous_of_task().events[event].name;
        let course = format!("the event {name} must not happen again at the same moment");
        self.require(&course, vec![vec![broken]]);
    }

    /// Returns the value of a fluent after an update; `old` is its value if it has already been
    /// updated at this moment.
    fn updated(
        &self,
        operator: UpdateOperator,
        fluent: FluentId,
        old: Option<Linear>,
        value: &Expression,
    ) -> Result<Linear, Refusal> {
        let view = self.view(&self.now);
        let value = view.value(value)?;
        if operator == UpdateOperator::Assign {
            return Ok(value);
        }
        let old = match old {
            Some(old) => old,
            None => view.value(&Expression::Fluent(fluent))?,
        };
        let new = match operator {
            UpdateOperator::Assign => Some(value),
            UpdateOperator::Increase => Some(old.plus(&value)),
            UpdateOperator::Decrease => Some(old.minus(&value)),
            UpdateOperator::ScaleUp => old.times(&value),
            UpdateOperator::ScaleDown => {
                let factor = value.as_constant().and_then(Rational::reciprocal);
                factor.map(|factor| old.scaled(&factor))
            }
        };
        new.ok_or_else(|| Refusal::NotLinear {
            place: "an event".to_owned(),
            expression: format!("a {} effect", operator.name()),
        })
    }
}
