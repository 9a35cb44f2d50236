//! What was found before, for when the same circumstances come again.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_model::ground::FluentId;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId};
use indexmap::IndexMap;

use crate::circumstances::Circumstances;
use crate::model::Model;
use crate::total_order::TotalOrderPlan;

/// More than this are not kept; then all are forgotten.
const MOST: usize = 65_536;

/// All of the circumstances that the answer depends on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key {
    /// By fact of the model, as bits.
    belief: Vec<u64>,
    values: Vec<(FluentId, Rational)>,
    /// How long each has been under way.
    running: Vec<(InstanceId, Rational)>,
    /// How long ago each was.
    recent: Vec<(NodeId, Rational)>,
    /// Now, if the clock matters.
    now: Option<Rational>,
}

/// The key of these circumstances.
pub(super) fn key(model: &Model, circumstances: &Circumstances, has_deadlines: bool) -> Key {
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

/// What was found, shared by all clones. What is found depends on the key alone, so it does not
/// matter who asks first.
#[derive(Clone, Debug, Default)]
pub(super) struct Cache {
    known: Arc<Mutex<IndexMap<Key, Arc<Known>>>>,
}

impl Cache {
    /// The entry, if there is one.
    pub(super) fn get(&self, key: &Key) -> Option<Arc<Known>> {
        self.known().get(key).cloned()
    }

    pub(super) fn put(&self, key: Key, order: Option<&TotalOrderPlan>, now: &Rational) {
        let mut all = self.known();
        if all.len() >= MOST {
            all.clear();
        }
        let known = Known {
            order: order.cloned(),
            began: now.clone(),
        };
        all.insert(key, Arc::new(known));
    }

    fn known(&self) -> MutexGuard<'_, IndexMap<Key, Arc<Known>>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A cached result of an earlier search.
#[derive(Clone, Debug)]
pub(super) struct Known {
    order: Option<TotalOrderPlan>,
    began: Rational,
}

impl Known {
    /// The order as it is if it begins now; `None` if there is none.
    pub(super) fn from(&self, now: &Rational) -> Option<TotalOrderPlan> {
        let delay = now - &self.began;
        self.order.as_ref().map(|order| order.delayed(&delay))
    }
}
