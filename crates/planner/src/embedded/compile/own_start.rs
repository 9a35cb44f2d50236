//! Possible effects of an action's start, and the part of its over-all condition that they do not meet.

use std::collections::BTreeSet;

use super::{Action, Change, Compiled, NONE, Rule, Snap};
use crate::embedded::formula::{Formula, Literal, Test};

impl Compiled {
    /// Returns the part of the over-all condition that must hold before the action starts. The
    /// start may achieve the other parts: at once, by a conditional effect, or through a rule.
    /// Numeric tests are omitted. If starts of one moment depend on each other, the result is
    /// empty.
    pub(crate) fn needed_before_start(&self, action: &Action) -> Formula {
        if action.start == NONE || self.starts_depend_on_each_other {
            return Formula::default();
        }
        let changes = Changes::of_start(action, &self.snaps, &self.tests, &self.strata);
        changes.unsatisfied_part(&action.over_all, &self.tests)
    }
}

/// The literals that may become true, and the fluents that may change.
#[derive(Debug, Default)]
pub(super) struct Changes {
    pub(super) literals: BTreeSet<Literal>,
    fluents: BTreeSet<u32>,
}

impl Changes {
    /// Returns the changes by a happening, including consequences by rules.
    pub(super) fn of_happening(snap: &Snap, tests: &[Test], strata: &[Vec<Rule>]) -> Self {
        let mut changes = Self::default();
        changes.add_effects(snap);
        changes.add_derived(tests, strata);
        changes
    }

    /// Returns the changes by the start of an action, including continuous changes that begin with
    /// it.
    pub(super) fn of_start(
        action: &Action,
        snaps: &[Snap],
        tests: &[Test],
        strata: &[Vec<Rule>],
    ) -> Self {
        let mut changes = Self::default();
        let flows = action.flows.iter();
        changes.fluents.extend(flows.map(|flow| flow.fluent));
        changes.add_effects(&snaps[action.start as usize]);
        changes.add_derived(tests, strata);
        changes
    }

    fn add_effects(&mut self, snap: &Snap) {
        let adds = snap.adds.iter().map(|&fact| Literal::new(fact, true));
        let deletes = snap.deletes.iter().map(|&fact| Literal::new(fact, false));
        self.literals.extend(adds.chain(deletes));
        let updates = snap.updates.iter();
        self.fluents.extend(updates.map(|update| update.fluent));
        for effect in &snap.conditional {
            match &effect.change {
                Change::Add(fact) => {
                    self.literals.insert(Literal::new(*fact, true));
                }
                Change::Delete(fact) => {
                    self.literals.insert(Literal::new(*fact, false));
                }
                Change::Update(update) => {
                    self.fluents.insert(update.fluent);
                }
                Change::Cost(_) => {}
            }
        }
    }

    /// Adds derived facts: one may become true or false if a rule for it reads something that changes.
    fn add_derived(&mut self, tests: &[Test], strata: &[Vec<Rule>]) {
        for rules in strata {
            loop {
                let before = self.literals.len();
                for rule in rules {
                    let truth = Literal::new(rule.head, true);
                    if !self.literals.contains(&truth) && self.touch(&rule.body, tests) {
                        let falsehood = Literal::new(rule.head, false);
                        self.literals.extend([truth, falsehood]);
                    }
                }
                if self.literals.len() == before {
                    break;
                }
            }
        }
    }

    /// Returns `true` if a change may affect the formula.
    fn touch(&self, formula: &Formula, tests: &[Test]) -> bool {
        let mut touches = false;
        formula.visit_literals(&mut |literal| {
            let opposite = Literal::new(literal.fact(), !literal.truth());
            touches |= self.literals.contains(&literal) || self.literals.contains(&opposite);
        });
        formula.visit_tests(&mut |test| {
            let difference = &tests[test as usize].difference;
            difference.visit_fluents(&mut |fluent| touches |= self.fluents.contains(&fluent));
        });
        touches
    }

    /// Returns the literals and choices of a condition that these changes do not make true.
    pub(super) fn unsatisfied_part(&self, condition: &Formula, tests: &[Test]) -> Formula {
        let is_foreign = |literal: &&Literal| !self.literals.contains(literal);
        let literals = condition.literals.iter().filter(is_foreign).copied();
        let is_untouched =
            |choice: &&Vec<Formula>| !choice.iter().any(|part| self.touch(part, tests));
        let choices = condition.choices.iter().filter(is_untouched).cloned();
        Formula {
            literals: literals.collect(),
            tests: Vec::new(),
            choices: choices.collect(),
        }
    }
}
