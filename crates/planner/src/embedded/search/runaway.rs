//! Detection of sequences of steps that only change numbers and do not approach the goal.
//!
//! Numbers are unbounded, so such a sequence can be infinite, with each of its states new. After
//! some steps, each further one increases the rank.

use super::super::state::State;
use super::{Node, Search};

/// Number of such steps without a penalty.
const PENALTY_FREE_STEPS: u32 = 8;

/// Length of the latest part of a state's path that only changed numbers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Drift {
    /// Hash of the state without numbers.
    facts: u64,
    estimate: u32,
    /// Number of earlier states with the same facts, one or two steps apart, none of them with a
    /// higher estimate than the next one.
    length: u32,
}

impl Drift {
    /// Returns the addition to the rank.
    pub(super) fn penalty(self) -> i64 {
        i64::from(self.length.saturating_sub(PENALTY_FREE_STEPS))
    }
}

impl Search<'_> {
    /// Returns the drift of a state that is reached by a step from `parent`.
    pub(super) fn drift(&self, parent: u32, state: &State, estimate: u32) -> Drift {
        if self.compiled.fluents.is_empty() {
            return Drift::default();
        }
        let facts = state.fact_hash();
        let parent = self.nodes.get(parent as usize);
        let grandparent = parent.and_then(|parent| self.nodes.get(parent.origin.parent as usize));
        let mut before = [parent, grandparent].into_iter().flatten().map(Node::drift);
        let similar = before.find(|drift| drift.facts == facts);
        let length = match similar {
            Some(drift) if drift.estimate <= estimate => drift.length + 1,
            _ => 0,
        };
        Drift {
            facts,
            estimate,
            length,
        }
    }
}
