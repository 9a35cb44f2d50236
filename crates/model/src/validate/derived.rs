//! Derived facts: the stratified least fixpoint of their rules.

use std::collections::{BTreeMap, BTreeSet};

use super::reading::{Fault, Moment, holds};
use crate::ground::{Condition, Expression, FactId};
use crate::problem::Comparison;
use crate::task::{GroundRule, Task};

/// The rules of a task, sorted so that what a rule negates is settled before the rule is used.
pub(super) struct Derivation<'a> {
    /// Rules of one stratum; lower strata first.
    strata: Vec<Vec<&'a GroundRule>>,
    /// The facts that rules define.
    heads: BTreeSet<FactId>,
}

impl<'a> Derivation<'a> {
    /// `None` if a derived fact depends on its own negation.
    pub(super) fn of(task: &'a Task) -> Option<Self> {
        let mut level: BTreeMap<FactId, usize> =
            task.rules().iter().map(|rule| (rule.head, 0)).collect();
        let highest = level.len();
        let mut has_changed = true;
        while has_changed {
            has_changed = false;
            for rule in task.rules() {
                let mut needed = 0;
                visit_signed(&rule.body, true, &mut |fact, is_positive| {
                    if let Some(below) = level.get(&fact) {
                        needed = needed.max(below + usize::from(!is_positive));
                    }
                });
                let current = level.entry(rule.head).or_default();
                if *current < needed {
                    *current = needed;
                    has_changed = true;
                }
                // Each level above 0 needs a fact of its own below it.
                if needed > highest {
                    return None;
                }
            }
        }
        let mut strata = vec![Vec::new(); level.values().max().map_or(0, |top| top + 1)];
        for rule in task.rules() {
            strata[level[&rule.head]].push(rule);
        }
        let heads = level.into_keys().collect();
        Some(Self { strata, heads })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.strata.is_empty()
    }

    /// Whether rules define the fact.
    pub(super) fn defines(&self, fact: FactId) -> bool {
        self.heads.contains(&fact)
    }

    /// Calls `visit` for the body of each rule.
    pub(super) fn visit_bodies(&self, visit: &mut impl FnMut(&Condition)) {
        for rule in self.strata.iter().flatten() {
            visit(&rule.body);
        }
    }

    /// The truth of derived facts when basic facts and numbers are as `basic` says.
    pub(super) fn derive(&self, basic: &dyn Moment) -> Derived {
        let mut derived = Derived::default();
        for stratum in &self.strata {
            // First what certainly holds, then what rests on something that says nothing.
            for accept in [Derived::accept_true, Derived::accept_unclear] {
                let mut has_grown = true;
                while has_grown {
                    has_grown = false;
                    for rule in stratum {
                        if derived.is_settled(rule.head) {
                            continue;
                        }
                        let truth = holds(&rule.body, &self.on_top_of(basic, &derived));
                        has_grown |= accept(&mut derived, rule.head, &truth);
                    }
                }
            }
        }
        derived
    }

    /// A moment with its derived facts.
    pub(super) fn on_top_of<'b>(
        &'b self,
        basic: &'b dyn Moment,
        derived: &'b Derived,
    ) -> impl Moment + 'b {
        With {
            heads: &self.heads,
            basic,
            derived,
        }
    }
}

/// The truth of derived facts at one moment.
#[derive(Debug, Default)]
pub(super) struct Derived {
    holding: BTreeSet<FactId>,
    unclear: BTreeMap<FactId, Fault>,
}

impl Derived {
    fn is_settled(&self, fact: FactId) -> bool {
        self.holding.contains(&fact) || self.unclear.contains_key(&fact)
    }

    fn accept_true(&mut self, head: FactId, truth: &Result<bool, Fault>) -> bool {
        *truth == Ok(true) && self.holding.insert(head)
    }

    fn accept_unclear(&mut self, head: FactId, truth: &Result<bool, Fault>) -> bool {
        truth
            .as_ref()
            .is_err_and(|fault| self.unclear.insert(head, fault.clone()).is_none())
    }
}

struct With<'a> {
    heads: &'a BTreeSet<FactId>,
    basic: &'a dyn Moment,
    derived: &'a Derived,
}

impl Moment for With<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Fault> {
        if !self.heads.contains(&fact) {
            self.basic.fact(fact)
        } else if let Some(fault) = self.derived.unclear.get(&fact) {
            Err(fault.clone())
        } else {
            Ok(self.derived.holding.contains(&fact))
        }
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Fault> {
        self.basic.compare(comparison, left, right)
    }
}

/// Calls `visit` for each fact with whether it stands under an even number of negations.
fn visit_signed(condition: &Condition, sign: bool, visit: &mut impl FnMut(FactId, bool)) {
    match condition {
        Condition::Fact(fact) => visit(*fact, sign),
        Condition::Compare(..) => {}
        Condition::Not(part) => visit_signed(part, !sign, visit),
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                visit_signed(part, sign, visit);
            }
        }
    }
}
