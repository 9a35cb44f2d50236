//! Fluents that never have a value. No plan contains an action that reads one.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{
    Action, Body, Change, Condition, Expression, FluentId, Guard, SnapAction,
};
use elbowroom_model::problem::UpdateOperator;

use super::static_facts::{StaticFacts, Value};

impl StaticFacts {
    /// Returns `true` if the fluent has no value at any time: it has none initially, and nothing assigns one.
    pub(super) fn is_valueless(&self, task: &Task, fluent: FluentId) -> bool {
        !task.initial().values.contains_key(&fluent) && !self.is_assigned(task.function_of(fluent))
    }

    /// Adds the valueless fluents that an action reads in any case, so that no plan contains it.
    pub(super) fn read_by_action(
        &self,
        task: &Task,
        action: &Action,
        found: &mut BTreeSet<FluentId>,
    ) {
        match &action.body {
            Body::Instantaneous(snap) => self.read_by_snap(task, snap, found),
            Body::Durative(body) => {
                self.read_by_snap(task, &body.start, found);
                self.read_by_snap(task, &body.end, found);
                for bound in &body.duration {
                    self.read_by_expression(task, &bound.bound, found);
                }
            }
        }
    }

    /// Adds the valueless fluents of comparisons without which a condition does not hold.
    fn read_by_condition(
        &self,
        task: &Task,
        condition: &Condition,
        found: &mut BTreeSet<FluentId>,
    ) {
        for part in condition.conjuncts() {
            if let Condition::Compare(_, left, right) = part {
                self.read_by_expression(task, left, found);
                self.read_by_expression(task, right, found);
            }
        }
    }

    /// Adds the valueless fluents that a condition mentions anywhere, including through rules.
    pub(super) fn mentioned_by_condition(
        &self,
        task: &Task,
        condition: &Condition,
        found: &mut BTreeSet<FluentId>,
    ) {
        task.visit_fluents_of(condition, &mut |fluent| {
            if self.is_valueless(task, fluent) {
                found.insert(fluent);
            }
        });
    }

    /// Adds the valueless fluents that an action mentions anywhere. A plan may contain the action nevertheless.
    pub(super) fn mentioned_by_action(
        &self,
        task: &Task,
        action: &Action,
        found: &mut BTreeSet<FluentId>,
    ) {
        self.read_by_action(task, action, found);
        let (snaps, body) = match &action.body {
            Body::Instantaneous(snap) => (vec![snap], None),
            Body::Durative(body) => (vec![&*body.start, &*body.end], Some(body)),
        };
        for snap in snaps {
            self.mentioned_by_condition(task, &snap.condition, found);
            for effect in &snap.effects {
                self.mentioned_by_guard(task, &effect.guard, found);
                if let Change::Update { value, .. } = &effect.change {
                    self.read_by_expression(task, value, found);
                }
            }
        }
        let Some(body) = body else { return };
        self.mentioned_by_condition(task, &body.over_all, found);
        for effect in &body.continuous {
            self.mentioned_by_guard(task, &effect.guard, found);
            self.read_by_expression(task, &effect.rate, found);
            if self.is_valueless(task, effect.fluent) {
                found.insert(effect.fluent);
            }
        }
    }

    fn mentioned_by_guard(&self, task: &Task, guard: &Guard, found: &mut BTreeSet<FluentId>) {
        for condition in [&guard.at_start, &guard.over_all, &guard.now] {
            self.mentioned_by_condition(task, condition, found);
        }
    }

    fn read_by_snap(&self, task: &Task, snap: &SnapAction, found: &mut BTreeSet<FluentId>) {
        self.read_by_condition(task, &snap.condition, found);
        for effect in snap.effects.iter().filter(|own| own.guard.is_trivial()) {
            let Change::Update {
                operator,
                fluent,
                value,
            } = &effect.change
            else {
                continue;
            };
            self.read_by_expression(task, value, found);
            if *operator != UpdateOperator::Assign && self.is_valueless(task, *fluent) {
                found.insert(*fluent);
            }
        }
    }

    fn read_by_expression(
        &self,
        task: &Task,
        expression: &Expression,
        found: &mut BTreeSet<FluentId>,
    ) {
        if self.stated_value(task, expression) != Value::Undefined {
            return;
        }
        expression.visit_fluents(&mut |fluent| {
            if self.is_valueless(task, fluent) {
                found.insert(fluent);
            }
        });
    }
}
