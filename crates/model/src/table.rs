//! Table of ground facts and fluents, which maps numbers to atoms.

use std::sync::{Arc, OnceLock};

use indexmap::Equivalent;

use crate::derivation::{Derivation, Rules};
use crate::ground::{FactId, FluentId};
use crate::hash::Set;
use crate::problem::{FunctionId, ObjectId, PredicateId};

/// The facts and fluents mentioned so far, numbered in the order of their first mention, and the
/// rules of the derived facts among them.
///
/// The table only grows: a number never changes its meaning.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    facts: Set<(PredicateId, Vec<ObjectId>)>,
    fluents: Set<(FunctionId, Vec<ObjectId>)>,
    rules: Arc<Rules>,
    /// Sorted rules, computed on demand; inside, `None` if a fact depends on its own negation.
    derivation: OnceLock<Option<Derivation>>,
}

impl Table {
    pub(crate) fn fact_count(&self) -> usize {
        self.facts.len()
    }

    pub(crate) fn fluent_count(&self) -> usize {
        self.fluents.len()
    }

    /// Returns the number of a fact, if it has one.
    pub(crate) fn find_fact(
        &self,
        predicate: PredicateId,
        arguments: &[ObjectId],
    ) -> Option<FactId> {
        let index = self.facts.get_index_of(&Key(predicate, arguments));
        index.map(|index| FactId(narrow(index)))
    }

    /// Returns the number of a fluent, if it has one.
    pub(crate) fn find_fluent(
        &self,
        function: FunctionId,
        arguments: &[ObjectId],
    ) -> Option<FluentId> {
        let index = self.fluents.get_index_of(&Key(function, arguments));
        index.map(|index| FluentId(narrow(index)))
    }

    /// Returns the number of a fact, and `true` if it is new.
    pub(crate) fn fact(
        &mut self,
        predicate: PredicateId,
        arguments: &[ObjectId],
    ) -> (FactId, bool) {
        if let Some(fact) = self.find_fact(predicate, arguments) {
            return (fact, false);
        }
        let (index, _) = self.facts.insert_full((predicate, arguments.to_vec()));
        (FactId(narrow(index)), true)
    }

    /// Returns the number of a fluent.
    pub(crate) fn fluent(&mut self, function: FunctionId, arguments: &[ObjectId]) -> FluentId {
        if let Some(fluent) = self.find_fluent(function, arguments) {
            return fluent;
        }
        let (index, _) = self.fluents.insert_full((function, arguments.to_vec()));
        FluentId(narrow(index))
    }

    /// Returns the predicate and the objects of a fact.
    pub(crate) fn atom(&self, fact: FactId) -> &(PredicateId, Vec<ObjectId>) {
        let atom = self.facts.get_index(fact.index());
        atom.expect("a fact of this table")
    }

    /// Returns the function and the objects of a fluent.
    pub(crate) fn application(&self, fluent: FluentId) -> &(FunctionId, Vec<ObjectId>) {
        let application = self.fluents.get_index(fluent.index());
        application.expect("a fluent of this table")
    }

    /// Returns the rules of all derived facts in the table.
    pub(crate) fn rules(&self) -> &Arc<Rules> {
        &self.rules
    }

    /// Returns the rules for additions. Invalidates the sorted rules.
    pub(crate) fn rules_mut(&mut self) -> &mut Rules {
        self.derivation.take();
        Arc::make_mut(&mut self.rules)
    }

    /// Returns the sorted rules of derived facts; `None` if a fact depends on its own negation.
    pub(crate) fn derivation(&self) -> Option<Derivation> {
        let derivation = self.derivation.get_or_init(|| Derivation::of(&self.rules));
        derivation.clone()
    }
}

/// A symbol with its arguments, for look-ups without an allocation.
#[derive(Hash)]
struct Key<'a, S>(S, &'a [ObjectId]);

impl<S: PartialEq> Equivalent<(S, Vec<ObjectId>)> for Key<'_, S> {
    fn equivalent(&self, (symbol, arguments): &(S, Vec<ObjectId>)) -> bool {
        self.0 == *symbol && self.1 == arguments
    }
}

/// Converts a position to a number. The upper half of the numbers is reserved for components that
/// need additional facts.
fn narrow(index: usize) -> u32 {
    let number = u32::try_from(index).ok();
    let number = number.filter(|&number| number < FactId::FIRST_FREE.0);
    number.expect("fewer than 2^31 facts and fluents")
}
