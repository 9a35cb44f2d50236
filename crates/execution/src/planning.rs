//! Port: sources of plans.

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::forward::forward_port;

/// Makes plans.
pub trait Planner: Send {
    /// Makes a plan from this situation. See [`Situation`] for the form of such a plan.
    ///
    /// The plan's facts and fluents are those of `task`, whose table may grow.
    fn plan(&mut self, task: &Task, situation: &Situation) -> Planned;

    /// Announces that a plan from this situation will probably be requested soon. Planners that can
    /// work in the background may begin with it. Answers do not depend on it.
    fn expect(&mut self, _task: &Task, _situation: &Situation) {}

    /// Begins to plan from this situation in the background, and replaces any search begun before.
    /// Returns `false` if the planner cannot do that. When there is an answer, the driver of the
    /// run reports [`Event::PlanMade`](crate::Event::PlanMade), and the run
    /// [collects](Planner::collect) it.
    fn begin(&mut self, _task: &Task, _situation: &Situation) -> bool {
        false
    }

    /// Returns the answer of the search that was begun; blocks until there is one.
    fn collect(&mut self, task: &Task, situation: &Situation) -> Planned {
        self.plan(task, situation)
    }

    /// Cancels the search that was begun.
    fn give_up(&mut self) {}

    /// Returns `false` if it never makes a plan.
    fn makes_plans(&self) -> bool {
        true
    }

    /// Returns `true` if the next answer is read from the record of a run. The planner must then be asked, even if the
    /// caller has a plan already: each request in the record has one answer.
    fn is_recorded(&self) -> bool {
        false
    }
}

forward_port!(Planner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> Planned;
    fn expect(&mut self, task: &Task, situation: &Situation);
    fn begin(&mut self, task: &Task, situation: &Situation) -> bool;
    fn collect(&mut self, task: &Task, situation: &Situation) -> Planned;
    fn give_up(&mut self);
} ref {
    fn makes_plans(&self) -> bool;
    fn is_recorded(&self) -> bool;
});

/// A planner's answer, with the planning time.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// The answer.
    pub answer: PlanAnswer,
    /// The planning time in seconds, if it was measured.
    pub seconds: Option<Rational>,
    /// A remark about the plan for users, for example the reason for which it was chosen.
    pub remark: Option<String>,
    /// Known reasons for which the goals have no plan.
    pub shortfall: Shortfall,
}

/// Reasons for which there is no plan, as far as the planner knows them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shortfall {
    /// The deadlines that cannot be met, or for which no plan was found.
    pub missed_deadlines: Vec<Lateness>,
    /// Conjuncts of the goal that exclude each other, as a certificate proves. None of them is
    /// known to be redundant.
    pub conflict: Vec<String>,
}

/// A deadline that is missed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lateness {
    /// Index of the deadline in [`Task::deadlines`].
    pub deadline_index: usize,
    /// The time at which the earliest plan found without deadlines reaches the goal.
    pub achieved_at: Option<Rational>,
    /// A time before which no plan reaches the goal, as a certificate proves.
    pub proven_lower_bound: Option<Rational>,
}

impl Lateness {
    /// Returns the lateness in words, after this deadline.
    pub fn in_words(&self, deadline: &Rational) -> Option<String> {
        let by = |time: &Rational| (time - deadline).to_decimal(3);
        let at = |time: &Rational| time.to_decimal(3);
        match (&self.achieved_at, &self.proven_lower_bound) {
            (Some(reached), Some(least)) if reached == least => Some(format!(
                "{} s late: it cannot be reached before {}",
                by(reached),
                at(least)
            )),
            (Some(reached), Some(least)) => Some(format!(
                "{} s late: the earliest plan found reaches it at {}, and no plan can reach it \
                 before {}",
                by(reached),
                at(reached),
                at(least)
            )),
            (Some(reached), None) => Some(format!(
                "{} s late: the earliest plan found reaches it at {}",
                by(reached),
                at(reached)
            )),
            (None, Some(least)) => Some(format!(
                "at least {} s late: it cannot be reached before {}",
                by(least),
                at(least)
            )),
            (None, None) => None,
        }
    }
}

impl From<PlanAnswer> for Planned {
    /// Creates an answer without a planning time and a remark.
    fn from(answer: PlanAnswer) -> Self {
        Self {
            answer,
            seconds: None,
            remark: None,
            shortfall: Shortfall::default(),
        }
    }
}

/// A planner's answer.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanAnswer {
    /// A plan.
    Plan(TimeTriggeredPlan),
    /// No plan exists, with a certificate that the verifier accepts.
    Unsolvable,
    /// No plan has been found; there may be one.
    NotFound {
        /// The reason.
        why: String,
    },
    /// The planner has failed, for example crashed. Plans may exist.
    Failed {
        /// The error.
        why: String,
    },
    /// There is no planner in this run.
    NoPlanner,
}

impl PlanAnswer {
    /// Returns the reason for which there is no plan, in words.
    pub fn failure_reason(&self) -> Option<&str> {
        match self {
            Self::Plan(_) => None,
            Self::Unsolvable => Some("no plan reaches the goal from here"),
            Self::NotFound { why } | Self::Failed { why } => Some(why),
            Self::NoPlanner => Some("there is no planner in this run"),
        }
    }

    /// Returns the plan.
    pub fn plan(&self) -> Option<&TimeTriggeredPlan> {
        match self {
            Self::Plan(plan) => Some(plan),
            Self::Unsolvable | Self::NotFound { .. } | Self::Failed { .. } | Self::NoPlanner => {
                None
            }
        }
    }
}

/// Planner without plans, for runs of a single given plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoPlanner;

impl Planner for NoPlanner {
    fn plan(&mut self, _task: &Task, _situation: &Situation) -> Planned {
        Planned::from(PlanAnswer::NoPlanner)
    }

    fn makes_plans(&self) -> bool {
        false
    }
}
