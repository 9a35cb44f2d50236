//! Record of the steps of a trial: [`StepRecord`].

use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::{State, TimeTriggeredPlan};

use super::Ending;

/// Kind of a step.
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

/// Entry of a course.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entry {
    /// Start of a round with this plan: the names of its actions, by start.
    Plan(Vec<String>),
    /// One step.
    Step {
        /// Its kind.
        kind: StepKind,
        /// Name of the action.
        action: String,
        /// Facts that it made true.
        became_true: Vec<FactId>,
        /// Facts that it made false.
        became_false: Vec<FactId>,
        /// `true` if the goal cannot be reached any more, if dead ends are detected.
        is_dead_end: bool,
    },
}

/// Course of a trial from its beginning to its end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StepRecord {
    /// Entries, in their order.
    pub entries: Vec<Entry>,
    /// Ending of the trial; `None` if the goal was reached, or during the trial.
    pub ending: Option<Ending>,
}

impl StepRecord {
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
