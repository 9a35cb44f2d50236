//! Changes of the belief state for a world that is a process: `docs/reference/formats/world-protocol.md`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom::execution::BeliefState;
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use serde_json::Value;

use crate::world_protocol::belief_message;

/// Changes of the belief state that the world has not received yet. Clones share the same changes: the run records
/// them, and the world takes them.
#[derive(Clone, Default)]
pub struct BeliefUpdates(Arc<Mutex<Pending>>);

#[derive(Default)]
struct Pending {
    /// The world does not process belief messages.
    is_unwanted: bool,
    now: Rational,
    facts: Vec<bool>,
    values: Vec<Option<Rational>>,
    /// Initial belief state, until it is sent.
    initial: Option<InitialBelief>,
    changed_facts: BTreeSet<FactId>,
    changed_values: BTreeSet<FluentId>,
}

struct InitialBelief {
    now: Rational,
    facts: Vec<FactId>,
    values: BTreeMap<FluentId, Rational>,
}

impl BeliefUpdates {
    /// Returns a callback that records the belief state, to be called from the start of the run on.
    pub fn listener(&self) -> impl FnMut(&BeliefState) + Send + use<> {
        let updates = self.clone();
        let mut has_begun = false;
        move |belief| {
            let mut pending = updates.lock();
            if !pending.is_unwanted {
                pending.note(belief, std::mem::replace(&mut has_begun, true));
            }
        }
    }

    /// Returns the pending messages: the initial belief state, then changes. If they are not wanted, no further
    /// changes are recorded.
    pub fn take_messages(&self, is_wanted: bool, task: &Task) -> Vec<Value> {
        let mut pending = self.lock();
        if !is_wanted {
            *pending = Pending {
                is_unwanted: true,
                ..Pending::default()
            };
        }
        pending.take_messages(task)
    }

    fn lock(&self) -> MutexGuard<'_, Pending> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Pending {
    fn note(&mut self, belief: &BeliefState, has_begun: bool) {
        let task = belief.task();
        self.now.clone_from(belief.time());
        let facts = (0..).map(FactId).take(task.fact_count());
        for (place, fact) in facts.enumerate() {
            let truth = belief.fact(fact);
            if place == self.facts.len() {
                self.facts.push(false);
            }
            if self.facts[place] != truth {
                self.facts[place] = truth;
                // A second change restores the value that was sent.
                if !self.changed_facts.remove(&fact) {
                    self.changed_facts.insert(fact);
                }
            }
        }
        let fluents = (0..).map(FluentId).take(task.fluent_count());
        for (place, fluent) in fluents.enumerate() {
            let value = belief.value(fluent);
            if place == self.values.len() {
                self.values.push(None);
            }
            if self.values[place].as_ref() != value {
                self.values[place] = value.cloned();
                self.changed_values.insert(fluent);
            }
        }
        if !has_begun {
            let values = std::mem::take(&mut self.changed_values).into_iter();
            self.initial = Some(InitialBelief {
                now: self.now.clone(),
                facts: std::mem::take(&mut self.changed_facts)
                    .into_iter()
                    .collect(),
                values: values
                    .filter_map(|it| Some((it, self.values[it.index()].clone()?)))
                    .collect(),
            });
        }
    }

    fn take_messages(&mut self, task: &Task) -> Vec<Value> {
        let mut messages = Vec::new();
        if let Some(initial) = self.initial.take() {
            let facts = initial.facts.into_iter().map(|it| (it, true));
            let values = initial.values.iter().map(|(it, value)| (*it, Some(value)));
            messages.push(belief_message(task, &initial.now, facts, values));
        }
        let facts = std::mem::take(&mut self.changed_facts);
        let values = std::mem::take(&mut self.changed_values);
        if !(facts.is_empty() && values.is_empty()) {
            let facts = facts.into_iter().map(|it| (it, self.facts[it.index()]));
            let values = values.into_iter();
            let values = values.map(|it| (it, self.values[it.index()].as_ref()));
            messages.push(belief_message(task, &self.now, facts, values));
        }
        messages
    }
}
