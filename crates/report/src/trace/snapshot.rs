//! Where a record begins anew: a run at rest, as a line.

use std::sync::Arc;

use elbowroom_execution::run::Rested;
use elbowroom_execution::{Progression, Standstill};
use elbowroom_model::Task;
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::exact::Exact;

/// The second line of a record that begins where a lasting run rested, in place of all that was
/// recorded before: `docs/formats/journal.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SnapshotLine {
    /// The time.
    pub now: Exact,
    /// Since when the run rests.
    pub since: Exact,
    /// How many actions were started.
    pub started: usize,
    /// How long making a plan is expected to take.
    pub allowance: Exact,
    /// How many answers of the world there were since then, for a clock that stands still.
    pub answers: usize,
    /// See `answers`.
    pub answers_since: Exact,
    /// How many timed initials have happened.
    pub timed: usize,
    /// The time of what happened last.
    pub group: Exact,
    /// All facts that were ever mentioned, in this order, and whether they are true.
    pub facts: IndexMap<String, bool>,
    /// All numbers that were ever mentioned, in this order, and their values.
    pub numbers: IndexMap<String, Option<Exact>>,
    /// What the facts were that have changed at the time of what happened last.
    pub facts_before: IndexMap<String, bool>,
    /// The numbers, likewise.
    pub numbers_before: IndexMap<String, Option<Exact>>,
    /// Facts about which reports contradict each other.
    pub doubtful_facts: Vec<String>,
    /// Numbers about which reports contradict each other.
    pub doubtful_numbers: Vec<String>,
}

impl SnapshotLine {
    /// The line of a run of this task at rest.
    pub fn of(task: &Task, rested: &Rested) -> Self {
        let parts = rested.belief.standstill();
        let facts = (0..task.fact_count()).map(|index| {
            let truth = parts.facts.get(index).copied().unwrap_or(false);
            (task.fact_name(FactId(narrow(index))), truth)
        });
        let numbers = (0..task.fluent_count()).map(|index| {
            let value = parts.values.get(index).cloned().flatten();
            (task.fluent_name(FluentId(narrow(index))), value.map(Exact))
        });
        let facts_before = parts.facts_on_arrival.iter();
        let numbers_before = parts.values_on_arrival.iter();
        let doubtful_facts = parts.doubtful_facts.iter();
        let doubtful_numbers = parts.doubtful_values.iter();
        Self {
            now: Exact(parts.time.clone()),
            since: Exact(rested.since.clone()),
            started: rested.started,
            allowance: Exact(rested.allowance.clone()),
            answers: rested.answers.1,
            answers_since: Exact(rested.answers.0.clone()),
            timed: parts.timed,
            group: Exact(parts.group.clone()),
            facts: facts.collect(),
            numbers: numbers.collect(),
            facts_before: facts_before
                .map(|(fact, truth)| (task.fact_name(*fact), *truth))
                .collect(),
            numbers_before: numbers_before
                .map(|(fluent, value)| (task.fluent_name(*fluent), value.clone().map(Exact)))
                .collect(),
            doubtful_facts: doubtful_facts.map(|fact| task.fact_name(*fact)).collect(),
            doubtful_numbers: doubtful_numbers
                .map(|fluent| task.fluent_name(*fluent))
                .collect(),
        }
    }

    /// The run at rest. Its facts and numbers get the same places in the table of the task that they
    /// had, so that whatever goes by their order is decided as it would have been.
    ///
    /// # Errors
    /// In words, when the task has no such facts or numbers, or has others first.
    pub fn rested(&self, task: &Arc<Task>) -> Result<Rested, String> {
        for (index, name) in self.facts.keys().enumerate() {
            if fact(task, name)? != FactId(narrow(index)) {
                return Err(out_of_order(name));
            }
        }
        for (index, name) in self.numbers.keys().enumerate() {
            if fluent(task, name)? != FluentId(narrow(index)) {
                return Err(out_of_order(name));
            }
        }
        if self.timed > task.timed().len() {
            return Err("the problem has fewer timed initials".to_owned());
        }
        let value = |value: &Option<Exact>| value.as_ref().map(|it| it.0.clone());
        let facts_before = self.facts_before.iter();
        let numbers_before = self.numbers_before.iter();
        let parts = Standstill {
            time: self.now.0.clone(),
            group: self.group.0.clone(),
            facts: self.facts.values().copied().collect(),
            values: self.numbers.values().map(value).collect(),
            facts_on_arrival: facts_before
                .map(|(name, truth)| Ok((fact(task, name)?, *truth)))
                .collect::<Result<_, String>>()?,
            values_on_arrival: numbers_before
                .map(|(name, before)| Ok((fluent(task, name)?, value(before))))
                .collect::<Result<_, String>>()?,
            doubtful_facts: named(&self.doubtful_facts, |name| fact(task, name))?,
            doubtful_values: named(&self.doubtful_numbers, |name| fluent(task, name))?,
            timed: self.timed,
        };
        Ok(Rested {
            belief: Progression::at_standstill(Arc::clone(task), parts),
            since: self.since.0.clone(),
            started: self.started,
            allowance: self.allowance.0.clone(),
            answers: (self.answers_since.0.clone(), self.answers),
        })
    }

    /// The time.
    pub fn now(&self) -> &Rational {
        &self.now.0
    }
}

fn fact(task: &Task, name: &str) -> Result<FactId, String> {
    let known = task.fact_named(name);
    known.ok_or_else(|| format!("the problem has no fact `{name}`"))
}

fn fluent(task: &Task, name: &str) -> Result<FluentId, String> {
    let known = task.fluent_named(name);
    known.ok_or_else(|| format!("the problem has no number `{name}`"))
}

fn named<T: Ord>(
    names: &[String],
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<std::collections::BTreeSet<T>, String> {
    names.iter().map(|name| read(name)).collect()
}

fn out_of_order(name: &str) -> String {
    format!("`{name}` stands at another place in the problem")
}

fn narrow(index: usize) -> u32 {
    u32::try_from(index).expect("fewer than 2^32 facts and fluents")
}
