//! Cache of search results, by circumstances.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_model::ground::FluentId;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId};
use indexmap::IndexMap;

use crate::model::Model;
use crate::search_state::SearchState;
use crate::total_order::TotalOrderPlan;

/// Largest number of entries; then the cache is cleared.
const MAX_ENTRIES: usize = 65_536;

/// The parts of the circumstances that determine the result.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key {
    /// Probabilities of the model's facts, as bits.
    belief: Vec<u64>,
    values: Vec<(FluentId, Rational)>,
    /// Running actions, with the time since their start.
    running: Vec<(InstanceId, Rational)>,
    /// Recent happenings, with the time since then.
    recent: Vec<(NodeId, Rational)>,
    /// Present time, if the clock matters.
    now: Option<Rational>,
}

/// Returns the key of these circumstances.
pub(super) fn key(model: &Model, circumstances: &SearchState, has_deadlines: bool) -> Key {
    let probability = |&fact| circumstances.belief.probability(fact).to_bits();
    Key {
        belief: model.facts.iter().map(probability).collect(),
        values: circumstances
            .values
            .iter()
            .map(|(fluent, value)| (*fluent, value.clone()))
            .collect(),
        running: circumstances
            .running
            .iter()
            .map(|running| (running.instance, &circumstances.now - &running.start))
            .collect(),
        recent: circumstances
            .recent
            .iter()
            .map(|(node, time)| (*node, &circumstances.now - time))
            .collect(),
        now: has_deadlines.then(|| circumstances.now.clone()),
    }
}

/// Results, shared by all clones. A result depends only on its key, so the order of queries does
/// not matter.
#[derive(Clone, Debug, Default)]
pub(super) struct Cache {
    entries: Arc<Mutex<IndexMap<Key, Arc<CachedOrder>>>>,
}

impl Cache {
    /// Returns the entry, if there is one.
    pub(super) fn get(&self, key: &Key) -> Option<Arc<CachedOrder>> {
        self.lock_entries().get(key).cloned()
    }

    pub(super) fn put(&self, key: Key, order: Option<&TotalOrderPlan>, now: &Rational) {
        let mut all = self.lock_entries();
        if all.len() >= MAX_ENTRIES {
            all.clear();
        }
        let known = CachedOrder {
            order: order.cloned(),
            start: now.clone(),
        };
        all.insert(key, Arc::new(known));
    }

    fn lock_entries(&self) -> MutexGuard<'_, IndexMap<Key, Arc<CachedOrder>>> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Cached result of an earlier search.
#[derive(Clone, Debug)]
pub(super) struct CachedOrder {
    order: Option<TotalOrderPlan>,
    start: Rational,
}

impl CachedOrder {
    /// Returns the order as of `now`; `None` if there is none.
    pub(super) fn order_at(&self, now: &Rational) -> Option<TotalOrderPlan> {
        let delay = now - &self.start;
        self.order.as_ref().map(|order| order.delayed(&delay))
    }
}
