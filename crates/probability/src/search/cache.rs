//! What was found before, for when the same circumstances come again.

use elbowroom_model::ground::FluentId;
use elbowroom_num::Rational;
use elbowroom_plan::InstanceId;
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
        now: has_deadlines.then(|| circumstances.now.clone()),
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Cache {
    /// The orders, with the time at which they began.
    known: IndexMap<Key, Option<(TotalOrderPlan, Rational)>>,
}

impl Cache {
    /// What is known; inside, `None` if there is no order.
    pub(super) fn get(&self, key: &Key) -> Option<Option<Known<'_>>> {
        let known = self.known.get(key)?;
        Some(known.as_ref().map(|(order, began)| Known { order, began }))
    }

    pub(super) fn put(&mut self, key: Key, order: Option<&TotalOrderPlan>, now: &Rational) {
        if self.known.len() >= MOST {
            self.known.clear();
        }
        let order = order.map(|order| (order.clone(), now.clone()));
        self.known.insert(key, order);
    }
}

/// An order that was found at another time.
pub(super) struct Known<'a> {
    order: &'a TotalOrderPlan,
    began: &'a Rational,
}

impl Known<'_> {
    /// The order as it is if it begins now.
    pub(super) fn from(&self, now: &Rational) -> TotalOrderPlan {
        let delay = now - self.began;
        self.order.delayed(&delay)
    }
}
