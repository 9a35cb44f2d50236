//! What is believed while nothing is under way, in parts that can be written down.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;

use super::Progression;

/// A [`Progression`] in which nothing is running, but for its task.
#[derive(Clone, Debug, PartialEq)]
pub struct Standstill {
    /// The moment.
    pub time: Rational,
    /// The time of the last group of happenings.
    pub group: Rational,
    /// By fact: whether it is true. What is not listed is false.
    pub facts: Vec<bool>,
    /// By fluent: its value, if it has one. What is not listed has none.
    pub values: Vec<Option<Rational>>,
    /// What the facts that have changed in that group were on arrival.
    pub facts_on_arrival: BTreeMap<FactId, bool>,
    /// The values on arrival, likewise.
    pub values_on_arrival: BTreeMap<FluentId, Option<Rational>>,
    /// Facts about which reports contradict each other.
    pub doubtful_facts: BTreeSet<FactId>,
    /// Fluents about which reports contradict each other.
    pub doubtful_values: BTreeSet<FluentId>,
    /// How many groups of timed initials have happened.
    pub timed: usize,
}

impl Progression {
    /// The parts of what is believed, but for what is running.
    pub fn standstill(&self) -> Standstill {
        Standstill {
            time: self.time.clone(),
            group: self.group.clone(),
            facts: self.facts.clone(),
            values: self.values.clone(),
            facts_on_arrival: self.facts_on_arrival.clone(),
            values_on_arrival: self.values_on_arrival.clone(),
            doubtful_facts: self.doubtful_facts.clone(),
            doubtful_values: self.doubtful_values.clone(),
            timed: self.timed,
        }
    }

    /// What is believed, of these parts, while nothing is running.
    pub fn at_standstill(task: Arc<Task>, parts: Standstill) -> Self {
        Self {
            task,
            time: parts.time,
            facts: parts.facts,
            values: parts.values,
            group: parts.group,
            facts_on_arrival: parts.facts_on_arrival,
            values_on_arrival: parts.values_on_arrival,
            doubtful_facts: parts.doubtful_facts,
            doubtful_values: parts.doubtful_values,
            timed: parts.timed,
            running: BTreeMap::new(),
        }
    }
}
