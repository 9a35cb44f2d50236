//! Ground rules, indexed by their heads.

use std::collections::BTreeMap;
use std::ops::{Deref, Range};

use crate::ground::{Condition, FactId};

/// `head` holds whenever `body` does.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundRule {
    /// The derived fact.
    pub head: FactId,
    /// Condition under which it holds.
    pub body: Condition,
}

/// List of rules. Rules with the same head are contiguous.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    list: Vec<GroundRule>,
    by_head: BTreeMap<FactId, Range<usize>>,
}

impl Rules {
    /// Adds all rules of a head that has no rules yet.
    pub(crate) fn add(&mut self, head: FactId, bodies: Vec<Condition>) {
        if bodies.is_empty() {
            return;
        }
        let first = self.list.len();
        self.list
            .extend(bodies.into_iter().map(|body| GroundRule { head, body }));
        let before = self.by_head.insert(head, first..self.list.len());
        debug_assert!(
            before.is_none(),
            "all rules of a head are added in one call"
        );
    }

    /// Returns the rules with this head; none for a basic fact.
    pub fn of(&self, head: FactId) -> &[GroundRule] {
        match self.by_head.get(&head) {
            Some(range) => &self.list[range.clone()],
            None => &[],
        }
    }

    /// Returns `true` if a rule has this head.
    pub(crate) fn define(&self, fact: FactId) -> bool {
        self.by_head.contains_key(&fact)
    }

    /// Returns each fact that has rules, once.
    pub(crate) fn heads(&self) -> impl ExactSizeIterator<Item = FactId> + '_ {
        self.by_head.keys().copied()
    }
}

impl Deref for Rules {
    type Target = [GroundRule];

    fn deref(&self) -> &[GroundRule] {
        &self.list
    }
}
