//! Derived facts: the stratified least fixpoint of their rules.
//!
//! Facts that depend on each other form a stratum. A stratum is evaluated after those that it
//! depends on, in time linear in the size of its rules, and without recursion along chains of
//! rules.

mod circuit;
mod rules;
mod strata;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ground::{Condition, Expression, FactId};
use crate::problem::Comparison;

pub use rules::{GroundRule, Rules};
use strata::Strata;

/// A moment at which conditions are read. A fact or a comparison may be undefined, for the reason
/// `F`.
pub trait Moment<F> {
    /// Returns the truth value of a fact.
    ///
    /// # Errors
    /// The fact is undefined.
    fn fact(&self, fact: FactId) -> Result<bool, F>;

    /// Returns the truth value of `left comparison right`.
    ///
    /// # Errors
    /// The comparison is undefined.
    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, F>;
}

/// Returns `true` if the condition holds. An undefined part is ignored if the other parts decide:
/// `(or (p) (> (undefined) 0))` holds if `(p)` does.
///
/// # Errors
/// The first fault, if the other parts do not decide.
pub fn holds<F>(condition: &Condition, moment: &dyn Moment<F>) -> Result<bool, F> {
    match condition {
        Condition::Fact(fact) => moment.fact(*fact),
        Condition::Compare(comparison, left, right) => moment.compare(*comparison, left, right),
        Condition::Not(part) => holds(part, moment).map(|value| !value),
        Condition::And(parts) => combine_truths(parts, moment, false),
        Condition::Or(parts) => combine_truths(parts, moment, true),
    }
}

/// Returns `decisive` if one part has that value, its opposite if no part has it, else the first
/// fault.
fn combine_truths<'a, F>(
    parts: impl IntoIterator<Item = &'a Condition>,
    moment: &dyn Moment<F>,
    decisive: bool,
) -> Result<bool, F> {
    let mut fault = None;
    for part in parts {
        match holds(part, moment) {
            Ok(value) if value == decisive => return Ok(decisive),
            Ok(_) => {}
            Err(new) => fault = fault.or(Some(new)),
        }
    }
    fault.map_or(Ok(!decisive), Err)
}

/// Rules of a task, sorted so that a negated fact is evaluated before the rules that use it.
///
/// This is a snapshot: it does not contain rules of facts that are mentioned later.
#[derive(Clone, Debug, Default)]
pub struct Derivation {
    /// `None` if there are no rules.
    sorted: Option<Arc<Sorted>>,
}

#[derive(Debug)]
struct Sorted {
    rules: Arc<Rules>,
    strata: Strata,
}

impl Derivation {
    /// Returns `None` if a derived fact depends on its own negation.
    pub(crate) fn of(rules: &Arc<Rules>) -> Option<Self> {
        if rules.is_empty() {
            return Some(Self::default());
        }
        let strata = Strata::of(rules)?;
        let rules = Arc::clone(rules);
        let sorted = Some(Arc::new(Sorted { rules, strata }));
        Some(Self { sorted })
    }

    fn rules(&self) -> &[GroundRule] {
        self.sorted.as_ref().map_or(&[], |sorted| &sorted.rules)
    }

    fn rules_of(&self, fact: FactId) -> &[GroundRule] {
        let sorted = self.sorted.as_ref();
        sorted.map_or(&[], |sorted| sorted.rules.of(fact))
    }

    /// Returns `true` if rules define the fact.
    pub fn defines(&self, fact: FactId) -> bool {
        let sorted = self.sorted.as_ref();
        sorted.is_some_and(|sorted| sorted.rules.define(fact))
    }

    /// Returns `true` if rules define any fact that the condition reads.
    pub fn is_read_by(&self, condition: &Condition) -> bool {
        let mut is_read = false;
        if self.sorted.is_some() {
            condition.visit_facts(&mut |fact| is_read |= self.defines(fact));
        }
        is_read
    }

    /// Calls `visit` for the body of each rule.
    pub fn visit_bodies(&self, visit: &mut impl FnMut(&Condition)) {
        for rule in self.rules() {
            visit(&rule.body);
        }
    }

    /// Computes the derived facts, with basic facts and numbers from `basic`.
    ///
    /// In each stratum, first the facts that certainly hold are found, then those that depend on an
    /// undefined part. All others are false.
    pub fn derive<F: Clone>(&self, basic: &dyn Moment<F>) -> Derived<F> {
        let mut derived = Derived {
            holding: Vec::new(),
            unclear: BTreeMap::new(),
        };
        let Some(sorted) = &self.sorted else {
            return derived;
        };
        derived.holding.resize(sorted.strata.table_size(), false);
        for stratum in sorted.strata.iter() {
            match stratum {
                [fact] if !sorted.strata.is_recursive(*fact) => {
                    let bodies = self.rules_of(*fact).iter().map(|rule| &rule.body);
                    let truth =
                        combine_truths(bodies, &self.with_derived_facts(basic, &derived), true);
                    match truth {
                        Ok(truth) => derived.holding[fact.index()] = truth,
                        Err(fault) => derived.set_unclear(*fact, fault),
                    }
                }
                stratum => circuit::evaluate_stratum(self, stratum, basic, &mut derived),
            }
        }
        derived
    }

    /// Returns the moment `basic` with its derived facts.
    pub fn with_derived_facts<'b, F: Clone>(
        &'b self,
        basic: &'b dyn Moment<F>,
        derived: &'b Derived<F>,
    ) -> impl Moment<F> + 'b {
        With {
            derivation: self,
            basic,
            derived,
        }
    }
}

/// Truth values of derived facts at one moment.
#[derive(Clone, Debug)]
pub struct Derived<F> {
    /// By position in the task's table.
    holding: Vec<bool>,
    unclear: BTreeMap<FactId, F>,
}

impl<F: Clone> Derived<F> {
    /// Returns `true` if a derived fact holds.
    ///
    /// # Errors
    /// The fact depends on an undefined part.
    pub fn truth(&self, fact: FactId) -> Result<bool, F> {
        match self.unclear.get(&fact) {
            Some(fault) => Err(fault.clone()),
            None => Ok(self.holds(fact)),
        }
    }

    fn holds(&self, fact: FactId) -> bool {
        self.holding.get(fact.index()).copied().unwrap_or(false)
    }

    fn is_settled(&self, fact: FactId) -> bool {
        self.holds(fact) || self.unclear.contains_key(&fact)
    }

    fn set_unclear(&mut self, fact: FactId, fault: F) {
        self.unclear.insert(fact, fault);
    }
}

struct With<'a, F> {
    derivation: &'a Derivation,
    basic: &'a dyn Moment<F>,
    derived: &'a Derived<F>,
}

impl<F: Clone> Moment<F> for With<'_, F> {
    fn fact(&self, fact: FactId) -> Result<bool, F> {
        if self.derivation.defines(fact) {
            self.derived.truth(fact)
        } else {
            self.basic.fact(fact)
        }
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, F> {
        self.basic.compare(comparison, left, right)
    }
}

#[cfg(test)]
mod tests;
