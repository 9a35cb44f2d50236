//! What a program that is a world is told of what is believed: `docs/formats/world-protocol.md`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom::execution::Progression;
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use serde_json::Value;

use crate::conversation::believed;

/// What is believed, as far as the world has not been told of it: the run notes, and the world fetches.
#[derive(Clone, Default)]
pub(super) struct Believed(Arc<Mutex<Known>>);

#[derive(Default)]
struct Known {
    /// Nobody wants to hear of it.
    is_unwanted: bool,
    now: Rational,
    facts: Vec<bool>,
    values: Vec<Option<Rational>>,
    /// The beginning, until it is told.
    beginning: Option<Beginning>,
    changed_facts: BTreeSet<FactId>,
    changed_values: BTreeSet<FluentId>,
}

struct Beginning {
    now: Rational,
    facts: Vec<FactId>,
    values: BTreeMap<FluentId, Rational>,
}

impl Believed {
    /// Notes what is believed, from the beginning on.
    pub(super) fn listener(&self) -> impl FnMut(&Progression) + Send + use<> {
        let known = self.clone();
        let mut has_begun = false;
        move |belief| {
            let mut known = known.known();
            if !known.is_unwanted {
                known.note(belief, std::mem::replace(&mut has_begun, true));
            }
        }
    }

    /// The messages that are due: the beginning, and then what has changed. Where they are not
    /// wanted, nothing is noted any more.
    pub(super) fn fetch(&self, is_wanted: bool, task: &Task) -> Vec<Value> {
        let mut known = self.known();
        if !is_wanted {
            *known = Known {
                is_unwanted: true,
                ..Known::default()
            };
        }
        known.fetch(task)
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Known {
    fn note(&mut self, belief: &Progression, has_begun: bool) {
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
                // What changes twice before it is told is as it was told.
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
            self.beginning = Some(Beginning {
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

    fn fetch(&mut self, task: &Task) -> Vec<Value> {
        let mut messages = Vec::new();
        if let Some(beginning) = self.beginning.take() {
            let facts = beginning.facts.into_iter().map(|it| (it, true));
            let values = beginning
                .values
                .iter()
                .map(|(it, value)| (*it, Some(value)));
            messages.push(believed(task, &beginning.now, facts, values));
        }
        let facts = std::mem::take(&mut self.changed_facts);
        let values = std::mem::take(&mut self.changed_values);
        if !(facts.is_empty() && values.is_empty()) {
            let facts = facts.into_iter().map(|it| (it, self.facts[it.index()]));
            let values = values.into_iter();
            let values = values.map(|it| (it, self.values[it.index()].as_ref()));
            messages.push(believed(task, &self.now, facts, values));
        }
        messages
    }
}
