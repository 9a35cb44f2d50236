//! Remaining task of a situation during execution, as a separate task.

use std::sync::Arc;

use elbowroom_num::{End, Interval, Rational};

use crate::ground::{
    Action, Body, Condition, DurationConstraint, DurativeBody, Expression, SnapAction,
};
use crate::plan::{Step, TimeTriggeredPlan};
use crate::problem::Comparison;
use crate::situation::{RunningAction, Situation};
use crate::state::TimedHappening;
use crate::task::Task;

impl Situation {
    /// Returns the remaining task, with a clock that reads 0 at [`Situation::time`].
    ///
    /// Its initial state is the situation's state, and its timed initials are the pending ones,
    /// shifted. Facts and fluents keep their numbers. Running actions are not part of it; a plan
    /// contains their remaining parts, see [`Situation::remaining_plan`]. [`Task::problem`] is still
    /// the original problem, with its initial facts and times. Trajectory constraints of the
    /// whole plan, other than [deadlines](Task::with_deadlines), cannot be evaluated from here; the
    /// validator reports this.
    #[must_use]
    pub fn remaining_task(&self, task: &Task) -> Task {
        let to_come = |timed: &&TimedHappening| timed.time > self.time;
        let moved = |timed: &TimedHappening| TimedHappening {
            time: &timed.time - &self.time,
            changes: timed.changes.clone(),
        };
        let mut rest = task.clone();
        rest.timed = task.timed.iter().filter(to_come).map(moved).collect();
        rest.initial = self.state.clone();
        if !rest.constraints.is_empty() {
            rest.constraints = Arc::new(rest.constraints.from(&self.time));
        }
        rest
    }

    /// Converts a plan from here to a plan of [`Situation::remaining_task`].
    ///
    /// Each running action becomes an action that starts at 0, without conditions or effects at its
    /// start, with the remaining duration and the same end.
    #[must_use]
    pub fn remaining_plan(&self, plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
        let continued = self
            .running
            .iter()
            .zip(&plan.steps)
            .map(|(running, step)| Step {
                start: Rational::ZERO,
                duration: step
                    .duration
                    .as_ref()
                    .map(|duration| &running.start + duration - &self.time),
                action: Arc::new(running.remaining_action(&self.time)),
            });
        let new = plan.new_steps(self).iter().map(|step| Step {
            start: &step.start - &self.time,
            ..step.clone()
        });
        TimeTriggeredPlan {
            steps: continued.chain(new).collect(),
        }
    }
}

impl RunningAction {
    /// Returns the remaining part of the action at `now`, as an action.
    #[must_use]
    pub fn remaining_action(&self, now: &Rational) -> Action {
        let elapsed = now - &self.start;
        let mut whole_duration = |leaf: &Expression| match leaf {
            Expression::Duration => Some(Expression::Add(vec![
                Expression::Duration,
                Expression::Constant(elapsed.clone()),
            ])),
            _ => None,
        };
        let action = self.action.map_leaves(&mut whole_duration);
        let Body::Durative(body) = action.body else {
            return action;
        };
        Action {
            body: Body::Durative(DurativeBody {
                duration: bounds(&self.duration, &elapsed),
                start: Arc::new(SnapAction {
                    condition: Condition::TRUE,
                    effects: Vec::new(),
                }),
                over_all: body.over_all,
                end: body.end,
                continuous: body.continuous,
                is_running: true,
            }),
            ..action
        }
    }
}

/// Returns the remaining possible durations, as duration constraints.
fn bounds(possible: &Interval, elapsed: &Rational) -> Vec<DurationConstraint> {
    let bound = |end: &End, closed, open| {
        let comparison = match end {
            End::Infinite => return None,
            End::Closed(_) => closed,
            End::Open(_) => open,
        };
        Some(DurationConstraint {
            comparison,
            bound: Expression::Constant((end.value()? - elapsed).max(Rational::ZERO)),
            at_end: false,
        })
    };
    let lower = bound(&possible.lower, Comparison::AtLeast, Comparison::Greater);
    let upper = bound(&possible.upper, Comparison::AtMost, Comparison::Less);
    lower.into_iter().chain(upper).collect()
}
