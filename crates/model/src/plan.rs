//! Plans with fixed times, as planners print them.

use std::sync::Arc;

use elbowroom_num::Rational;

use crate::ground::Action;

/// Actions with start times and durations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeTriggeredPlan {
    /// The steps, not necessarily sorted by time. Of a plan for what is left to do, the first ones
    /// are those that are under way ([`Situation`](crate::Situation)).
    pub steps: Vec<Step>,
}

/// One action of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// When it starts, or happens.
    pub start: Rational,
    /// The action, which a plan may have many times.
    pub action: Arc<Action>,
    /// The duration; `None` exactly for instantaneous actions.
    pub duration: Option<Rational>,
}

impl Step {
    /// The steps in order of start; those that start together stay as they are.
    pub fn by_start(steps: &[Self]) -> Vec<&Self> {
        let mut steps: Vec<&Self> = steps.iter().collect();
        steps.sort_by(|one, other| one.start.cmp(&other.start));
        steps
    }

    /// Puts the steps [in order of start](Self::by_start).
    pub fn sort_by_start(steps: &mut [Self]) {
        steps.sort_by(|one, other| one.start.cmp(&other.start));
    }

    /// The end time; its start, for an instantaneous action.
    pub fn end(&self) -> Rational {
        match &self.duration {
            Some(duration) => &self.start + duration,
            None => self.start.clone(),
        }
    }
}

impl TimeTriggeredPlan {
    /// The steps in order of start, by name and duration where they start together: the order in
    /// which a file lists those says nothing.
    #[must_use]
    pub fn in_order(mut self) -> Self {
        self.steps.sort_by(|one, other| {
            let by_name = || one.action.name.cmp(&other.action.name);
            let by_duration = || one.duration.cmp(&other.duration);
            let by_start = one.start.cmp(&other.start);
            by_start.then_with(by_name).then_with(by_duration)
        });
        self
    }

    /// The time of the last happening of the plan's actions; 0 for an empty plan.
    pub fn makespan(&self) -> Rational {
        self.steps.iter().map(Step::end).max().unwrap_or_default()
    }
}
