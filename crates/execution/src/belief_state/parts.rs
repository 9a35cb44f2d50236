//! Serializable parts of the believed state.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Condition, FactId, FluentId, Guard};
use elbowroom_model::{RunningAction, Task};
use elbowroom_num::{Interval, Rational};

use super::{BeliefState, Doubt, RunningActionState, decide_guards};
use crate::event::ActionHandle;

/// A [`BeliefState`] without its task and without the actions of its running instances.
#[derive(Clone, Debug, PartialEq)]
pub struct BeliefStateParts {
    /// The present time.
    pub time: Rational,
    /// The time of the last group of happenings.
    pub group: Rational,
    /// Truth by fact. Facts beyond the end of the list are false.
    pub facts: Vec<bool>,
    /// Value by fluent, if it has one. Fluents beyond the end of the list have none.
    pub values: Vec<Option<Rational>>,
    /// The truth on arrival of the facts that have changed in that group.
    pub facts_on_arrival: BTreeMap<FactId, bool>,
    /// The same for values.
    pub values_on_arrival: BTreeMap<FluentId, Option<Rational>>,
    /// Facts that are in doubt ([`BeliefState::doubt`]); `facts` has their truth before.
    pub doubtful_facts: BTreeMap<FactId, Vec<Doubt>>,
    /// Fluents whose values are in doubt.
    pub doubtful_values: BTreeMap<FluentId, Vec<Doubt>>,
    /// Number of groups of timed initials that have happened.
    pub timed: usize,
    /// The running actions.
    pub running: BTreeMap<ActionHandle, RunningActionParts>,
}

/// A [`RunningActionState`] without its action.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningActionParts {
    /// The time at which it started.
    pub start: Rational,
    /// The planned duration.
    pub planned: Rational,
    /// The decided guards.
    pub guards: Guards,
    /// Conjuncts of the over-all condition that have failed at some moment since the start.
    pub broken: BTreeSet<usize>,
}

/// The conditional effects of a running action that can still take place: `true` for these.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Guards {
    /// By end effect.
    pub at_end: Vec<bool>,
    /// By continuous effect.
    pub continuous: Vec<bool>,
}

impl BeliefState {
    /// Returns the parts of the state.
    pub fn parts(&self) -> BeliefStateParts {
        let running = self.running.iter().map(|(ticket, underway)| {
            let parts = RunningActionParts {
                start: underway.start.clone(),
                planned: underway.planned.clone(),
                guards: Guards {
                    at_end: underway.end_guards.clone(),
                    continuous: underway.continuous.clone(),
                },
                broken: underway.broken.clone(),
            };
            (*ticket, parts)
        });
        BeliefStateParts {
            time: self.time.clone(),
            group: self.group.clone(),
            facts: self.facts.clone(),
            values: self.values.clone(),
            facts_on_arrival: self.facts_on_arrival.clone(),
            values_on_arrival: self.values_on_arrival.clone(),
            doubtful_facts: self.doubtful_facts.clone(),
            doubtful_values: self.doubtful_values.clone(),
            timed: self.timed,
            running: running.collect(),
        }
    }

    /// Creates the state from its parts. `action` returns the action of a ticket; running instances
    /// without one are left out.
    pub fn from_parts(
        task: Arc<Task>,
        parts: BeliefStateParts,
        action: impl Fn(ActionHandle) -> Option<Arc<Action>>,
    ) -> Self {
        let running = parts.running.into_iter().filter_map(|(ticket, parts)| {
            let underway = RunningActionState {
                action: action(ticket)?,
                start: parts.start,
                planned: parts.planned,
                end_guards: parts.guards.at_end,
                continuous: parts.guards.continuous,
                broken: parts.broken,
            };
            Some((ticket, underway))
        });
        Self {
            running: running.collect(),
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
        }
    }
}

impl Guards {
    /// Returns the guards of `action` as they were decided in `running`. `None` if `running` is not
    /// an instance of `action`.
    pub fn of(action: &Action, running: &RunningAction) -> Option<Self> {
        let (whole, left) = (action.durative()?, running.action.durative()?);
        let at_end = whole.end.effects.iter().cloned().map(|mut effect| {
            clear_start_condition(&mut effect.guard);
            effect
        });
        let continuous = whole.continuous.iter().cloned().map(|mut effect| {
            clear_start_condition(&mut effect.guard);
            effect
        });
        Some(Self {
            at_end: membership_flags(at_end, &left.end.effects)?,
            continuous: membership_flags(continuous, &left.continuous)?,
        })
    }

    /// Returns `true` if there is one guard for each end effect and continuous effect of `action`.
    pub fn fit(&self, action: &Action) -> bool {
        action.durative().is_some_and(|body| {
            self.at_end.len() == body.end.effects.len()
                && self.continuous.len() == body.continuous.len()
        })
    }

    /// Returns the running action with these guards.
    pub fn running(&self, action: &Action, start: Rational, duration: Interval) -> RunningAction {
        let mut action = action.clone();
        if let Body::Durative(body) = &mut action.body {
            decide_guards(body, &self.at_end, &self.continuous);
        }
        RunningAction {
            action: Arc::new(action),
            start,
            duration,
        }
    }
}

fn clear_start_condition(guard: &mut Guard) {
    guard.at_start = Condition::TRUE;
}

/// Returns, for each element of `all`, whether it is in `left`, which has the same order. `None` if
/// `left` has other elements.
fn membership_flags<T: PartialEq>(all: impl Iterator<Item = T>, left: &[T]) -> Option<Vec<bool>> {
    let mut left = left.iter().peekable();
    let is_left = all.map(|it| left.next_if(|next| **next == it).is_some());
    let is_left: Vec<bool> = is_left.collect();
    left.next().is_none().then_some(is_left)
}
