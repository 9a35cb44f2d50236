//! Plans with fixed times, as planners print them.

use elbowroom_num::Rational;

use crate::ground::Action;

/// Actions with start times and durations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeTriggeredPlan {
    /// The steps in the order in which the plan lists them (not necessarily sorted by time).
    pub steps: Vec<Step>,
}

/// One action of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// When it starts, or happens.
    pub start: Rational,
    /// What is done.
    pub action: Action,
    /// How long it takes; `None` exactly for instantaneous actions.
    pub duration: Option<Rational>,
}

impl Step {
    /// When it ends; its start, for an instantaneous action.
    pub fn end(&self) -> Rational {
        match &self.duration {
            Some(duration) => &self.start + duration,
            None => self.start.clone(),
        }
    }
}

impl TimeTriggeredPlan {
    /// The time of the last happening of the plan's actions; 0 for an empty plan.
    pub fn makespan(&self) -> Rational {
        self.steps.iter().map(Step::end).max().unwrap_or_default()
    }
}
