//! Failures by chance, and their outcomes.

use std::sync::Arc;

use elbowroom_execution::{ActionHandle, Event};
use elbowroom_model::ground::{Action, Change};

use super::{ComingEvent, SimWorld};
use crate::model::{FactOutcome, Outcome};

impl SimWorld<'_> {
    /// Makes an action break down. It fails at once, or after the delay of its outcome.
    pub(super) fn break_down(&mut self, ticket: ActionHandle) {
        let Some(commanded) = self.actions.get_mut(&ticket) else {
            return;
        };
        commanded.is_broken = true;
        match commanded.outcome.map(|outcome| &outcome.delay) {
            Some(delay) if delay.is_positive() => {
                self.schedule(&self.now + delay, ComingEvent::Fail(ticket));
            }
            _ => self.fail_broken_action(ticket),
        }
    }

    /// Makes a broken action fail, undoes its start effects if the rule says so, and applies its
    /// outcome.
    pub(super) fn fail_broken_action(&mut self, ticket: ActionHandle) {
        let Some(commanded) = self.actions.get(&ticket).cloned() else {
            return;
        };
        let action = &commanded.action;
        let why = if commanded.has_started {
            "it broke down"
        } else {
            "it did not start"
        };
        self.fail(ticket, why);
        let failing = self.model.failure_rule(&action.name);
        if commanded.has_started && failing.is_some_and(|failing| failing.is_undone) {
            self.undo_start(action);
        }
        if let Some(outcome) = commanded.outcome {
            self.apply_outcome(outcome, action);
        }
    }

    fn undo_start(&mut self, action: &Arc<Action>) {
        let start = action
            .durative()
            .map_or(&[][..], |body| &body.start.effects);
        let changes = start.iter().filter(|effect| effect.guard.is_trivial());
        let changes = changes.map(|effect| &effect.change);
        let is_added = |fact| {
            let mut effects = start.iter();
            effects.any(|effect| effect.change == Change::Add(fact))
        };
        for change in changes {
            let (fact, truth) = match change {
                Change::Add(fact) => (*fact, false),
                // A fact that the start both deletes and adds becomes true.
                Change::Delete(fact) if !is_added(*fact) => (*fact, true),
                Change::Delete(_) | Change::Update { .. } => continue,
            };
            self.truth.change_fact(fact, truth);
            self.report(Event::Fact { fact, truth });
        }
    }

    fn apply_outcome(&mut self, outcome: &Outcome, action: &Action) {
        let task = Arc::clone(self.truth.task());
        for change in &outcome.changes {
            let name = change.target.instantiate(&action.name);
            let event = match &change.change {
                FactOutcome::Truth(truth) => {
                    // Facts with objects of the wrong type do not exist and are ignored.
                    let Some(fact) = task.fact_named(&name) else {
                        continue;
                    };
                    let truth = *truth;
                    self.truth.change_fact(fact, truth);
                    Event::Fact { fact, truth }
                }
                FactOutcome::Value(number) | FactOutcome::ChangedBy(number) => {
                    let Some(fluent) = task.fluent_named(&name) else {
                        continue;
                    };
                    let value = if matches!(change.change, FactOutcome::Value(_)) {
                        number.clone()
                    } else if let Some(value) = self.truth.value(fluent) {
                        value + number
                    } else {
                        continue;
                    };
                    self.truth.change_value(fluent, &value);
                    Event::Value { fluent, value }
                }
            };
            if outcome.is_reported {
                self.report(event);
            }
        }
    }
}
