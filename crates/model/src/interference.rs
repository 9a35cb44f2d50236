//! Interference of happenings: the no-moving-targets rule.

use std::collections::BTreeSet;

use crate::ground::{Action, Body, Change, Condition, Expression, FactId, FluentId, SnapAction};
use crate::state::TimedHappening;
use crate::task::Task;

/// Facts and fluents that a happening reads and writes.
///
/// Two happenings [interfere](Footprint::interferes_with) if their order matters, or if PDDL 2.1
/// treats them so (Fox & Long 2003, definition 12). Conditions of conditional effects count as
/// read, and their effects as written, even if they do not take place. Over-all conditions are not
/// part of any happening and do not count.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Footprint {
    /// Facts in conditions, positive or negative; a derived fact counts as all basic facts that
    /// its rules mention.
    pub reads: BTreeSet<FactId>,
    /// Facts made true.
    pub adds: BTreeSet<FactId>,
    /// Facts made false.
    pub deletes: BTreeSet<FactId>,
    /// Fluents in conditions, duration bounds, rates and right-hand sides.
    pub reads_fluents: BTreeSet<FluentId>,
    /// Fluents increased or decreased, at once or continuously.
    pub shifts: BTreeSet<FluentId>,
    /// Fluents changed in any other way.
    pub assigns: BTreeSet<FluentId>,
}

impl Footprint {
    /// Returns the footprint of an instantaneous action, or of a durative action's start.
    pub fn of_start(task: &Task, action: &Action) -> Self {
        let mut footprint = Self::default();
        match &action.body {
            Body::Instantaneous(snap) => footprint.include_snap(task, snap),
            Body::Durative(body) => {
                footprint.include_snap(task, &body.start);
                for constraint in body.duration.iter().filter(|constraint| !constraint.at_end) {
                    footprint.include_expression(&constraint.bound);
                }
                // The start reads the part of an end effect's guard that refers to the start.
                for effect in &body.end.effects {
                    footprint.include_condition(task, &effect.guard.at_start);
                }
                for effect in &body.continuous {
                    footprint.include_condition(task, &effect.guard.at_start);
                    footprint.include_expression(&effect.rate);
                    footprint.shifts.insert(effect.fluent);
                }
            }
        }
        footprint
    }

    /// Returns the footprint of a durative action's end; empty for an instantaneous action.
    pub fn of_end(task: &Task, action: &Action) -> Self {
        let mut footprint = Self::default();
        if let Body::Durative(body) = &action.body {
            footprint.include_snap(task, &body.end);
            for constraint in body.duration.iter().filter(|constraint| constraint.at_end) {
                footprint.include_expression(&constraint.bound);
            }
            footprint
                .shifts
                .extend(body.continuous.iter().map(|effect| effect.fluent));
        }
        footprint
    }

    /// Returns the footprint of timed initials.
    pub fn of_timed(timed: &TimedHappening) -> Self {
        let mut footprint = Self::default();
        for change in &timed.changes {
            footprint.include_change(change);
        }
        footprint
    }

    /// Returns the footprint of an event.
    pub fn of_snap(task: &Task, snap: &SnapAction) -> Self {
        let mut footprint = Self::default();
        footprint.include_snap(task, snap);
        footprint
    }

    /// Returns the footprint of a condition, which only reads.
    pub fn of_condition(task: &Task, condition: &Condition) -> Self {
        let mut footprint = Self::default();
        footprint.include_condition(task, condition);
        footprint
    }

    /// Adds a fact that becomes true or false.
    pub fn include_fact(&mut self, fact: FactId, becomes: bool) {
        let written = if becomes {
            &mut self.adds
        } else {
            &mut self.deletes
        };
        written.insert(fact);
    }

    /// Adds the footprint of another happening.
    pub fn include(&mut self, other: Self) {
        self.reads.extend(other.reads);
        self.adds.extend(other.adds);
        self.deletes.extend(other.deletes);
        self.reads_fluents.extend(other.reads_fluents);
        self.shifts.extend(other.shifts);
        self.assigns.extend(other.assigns);
    }

    /// Returns `true` if the two happenings must not happen at the same time.
    pub fn interferes_with(&self, other: &Self) -> bool {
        self.disturbs(other) || other.disturbs(self)
    }

    /// Returns `true` if this happening writes a fact or fluent that `other` reads, or contradicts
    /// its writes.
    fn disturbs(&self, other: &Self) -> bool {
        self.writes_reads_of(other) || self.contradicts(other)
    }

    /// Returns `true` if this happening contradicts a write of `other`.
    fn contradicts(&self, other: &Self) -> bool {
        !self.adds.is_disjoint(&other.deletes)
            || !self.assigns.is_disjoint(&other.assigns)
            || !self.assigns.is_disjoint(&other.shifts)
    }

    /// Returns `true` if this happening writes a fact or fluent that `other` reads.
    pub fn writes_reads_of(&self, other: &Self) -> bool {
        let touches = |facts: &BTreeSet<FactId>| !facts.is_disjoint(&other.reads);
        let moves = |fluents: &BTreeSet<FluentId>| !fluents.is_disjoint(&other.reads_fluents);
        touches(&self.adds) || touches(&self.deletes) || moves(&self.shifts) || moves(&self.assigns)
    }

    fn include_snap(&mut self, task: &Task, snap: &SnapAction) {
        self.include_condition(task, &snap.condition);
        for effect in &snap.effects {
            self.include_condition(task, &effect.guard.now);
            self.include_change(&effect.change);
        }
    }

    fn include_change(&mut self, change: &Change) {
        match change {
            Change::Add(fact) => {
                self.adds.insert(*fact);
            }
            Change::Delete(fact) => {
                self.deletes.insert(*fact);
            }
            Change::Update {
                operator,
                fluent,
                value,
            } => {
                if operator.is_additive() {
                    self.shifts.insert(*fluent);
                } else {
                    self.assigns.insert(*fluent);
                }
                self.include_expression(value);
            }
        }
    }

    fn include_condition(&mut self, task: &Task, condition: &Condition) {
        task.visit_facts_of(condition, &mut |fact| {
            self.reads.insert(fact);
        });
        task.visit_fluents_of(condition, &mut |fluent| {
            self.reads_fluents.insert(fluent);
        });
    }

    fn include_expression(&mut self, expression: &Expression) {
        expression.visit_fluents(&mut |fluent| {
            self.reads_fluents.insert(fluent);
        });
    }
}

impl Task {
    /// Calls `visit` for each basic fact that a condition reads; a derived fact counts as all
    /// basic facts that its rules mention, directly or through other derived facts.
    pub fn visit_facts_of(&self, condition: &Condition, visit: &mut impl FnMut(FactId)) {
        if self.problem.rules.is_empty() || self.rules().is_empty() {
            return condition.visit_facts(visit);
        }
        for fact in self.closure(condition) {
            if !self.is_derived(fact) {
                visit(fact);
            }
        }
    }

    /// Calls `visit` for each fluent that a condition reads, including through derived facts.
    pub fn visit_fluents_of(&self, condition: &Condition, visit: &mut impl FnMut(FluentId)) {
        condition.visit_fluents(visit);
        let rules = self.rules();
        if rules.is_empty() {
            return;
        }
        for fact in self.closure(condition) {
            for rule in rules.of(fact) {
                rule.body.visit_fluents(visit);
            }
        }
    }

    /// Returns the facts that a condition mentions and all facts that their rules mention,
    /// transitively.
    fn closure(&self, condition: &Condition) -> BTreeSet<FactId> {
        let rules = self.rules();
        let mut reached = BTreeSet::new();
        let mut frontier = Vec::new();
        let mut reach = |condition: &Condition, frontier: &mut Vec<FactId>| {
            condition.visit_facts(&mut |mentioned| {
                if reached.insert(mentioned) {
                    frontier.push(mentioned);
                }
            });
        };
        reach(condition, &mut frontier);
        while let Some(fact) = frontier.pop() {
            for rule in rules.of(fact) {
                reach(&rule.body, &mut frontier);
            }
        }
        reached
    }
}
