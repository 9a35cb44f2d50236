//! What was done in a trial, step by step: [`Course`].

use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::{State, TimeTriggeredPlan};

use super::Ending;

/// What a step was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepKind {
    /// A start that succeeded.
    Started,
    /// A start that failed.
    NotStarted,
    /// An end that succeeded.
    Ended,
    /// An end that failed.
    Failed,
}

/// What is told of a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entry {
    /// A round begins with this plan: the names of its actions, by start.
    Plan(Vec<String>),
    /// A step.
    Step {
        /// What it was.
        kind: StepKind,
        /// The action's name.
        action: String,
        /// The facts that are true since then.
        became_true: Vec<FactId>,
        /// The facts that are no longer true.
        became_false: Vec<FactId>,
        /// Whether the goal cannot be reached any more, as far as somebody looks out for that.
        is_dead_end: bool,
    },
}

/// A trial from its beginning to its end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Course {
    /// What happened, in order.
    pub entries: Vec<Entry>,
    /// How it ended; `None` if the goal was reached, or while it goes on.
    pub ending: Option<Ending>,
}

impl Course {
    pub(super) fn plan(&mut self, plan: &TimeTriggeredPlan) {
        let names = plan.steps.iter().map(|step| step.action.name.clone());
        self.entries.push(Entry::Plan(names.collect()));
    }

    pub(super) fn step(
        &mut self,
        kind: StepKind,
        action: &Action,
        (before, after): (&State, &State),
        is_dead_end: bool,
    ) {
        let only = |of: &State, other: &State| -> Vec<FactId> {
            of.facts.difference(&other.facts).copied().collect()
        };
        self.entries.push(Entry::Step {
            kind,
            action: action.name.clone(),
            became_true: only(after, before),
            became_false: only(before, after),
            is_dead_end,
        });
    }
}
