//! Facts and fluents by name.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::ground::{FactId, FluentId};

/// The names of a task's facts and fluents, to look up. Letter case does not matter.
#[derive(Clone, Debug, Default)]
pub struct Names {
    facts: BTreeMap<String, FactId>,
    fluents: BTreeMap<String, FluentId>,
}

impl Names {
    /// The names of a task.
    pub fn of(task: &Task) -> Self {
        let mut names = Self::default();
        names.learn(task);
        names
    }

    /// Takes up what has been added to a task.
    pub fn learn(&mut self, task: &Task) {
        let range = |known: usize, count: usize| {
            let narrow = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
            narrow(known)..narrow(count)
        };
        for index in range(self.facts.len(), task.fact_count()) {
            let name = task.fact_name(FactId(index)).to_ascii_lowercase();
            self.facts.insert(name, FactId(index));
        }
        for index in range(self.fluents.len(), task.fluent_count()) {
            let name = task.fluent_name(FluentId(index)).to_ascii_lowercase();
            self.fluents.insert(name, FluentId(index));
        }
    }

    /// The fact of that name, `(predicate object …)`.
    pub fn fact(&self, name: &str) -> Option<FactId> {
        self.facts.get(&tidy(name)).copied()
    }

    /// The fluent of that name, `(function object …)`.
    pub fn fluent(&self, name: &str) -> Option<FluentId> {
        self.fluents.get(&tidy(name)).copied()
    }
}

fn tidy(name: &str) -> String {
    let words = name.trim().trim_matches(['(', ')']).split_whitespace();
    format!("({})", words.collect::<Vec<_>>().join(" ")).to_ascii_lowercase()
}
