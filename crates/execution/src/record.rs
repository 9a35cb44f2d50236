//! Record of a run: all inputs and outputs, in order.

use elbowroom_model::{Situation, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::event::{ActionHandle, Command, Observation};
use crate::executor::{Decided, Planned, PreparedPlan};
use crate::forward::forward_port;
use crate::planning::Shortfall;
use crate::reason::Reason;
use crate::run::{Report, RunSnapshot, Verdict};

/// A change of a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GoalChange<'a> {
    /// The goal is achieved, and closed.
    Achieved,
    /// The goal is not pursued while others are, because no plan reaches it together with these.
    SetAside {
        /// The reason.
        why: &'a str,
    },
    /// The goal is pursued again.
    Pursued,
    /// The release time of the goal has come, and it is pursued.
    Released,
    /// The goal is to be kept, and holds.
    Kept,
    /// The goal is to be kept, does not hold, and is not pursued now.
    Queued {
        /// The reason.
        why: &'a str,
    },
    /// The goal is closed, and was not achieved by its deadline.
    Failed {
        /// The reason.
        why: &'a str,
    },
}

/// The cause of a warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WarningCause {
    /// The plan will soon be infeasible unless the action ends.
    Slack,
    /// The action will soon time out.
    Timeout,
}

/// Receives the record of a run, entry by entry.
pub trait Recorder: Send {
    /// Records an entry. Persistent recorders must write the entry before this returns, so that the
    /// record of an interrupted run is complete.
    fn record(&mut self, entry: &Entry<'_>);

    /// Called before the world receives the commands recorded since the last call, which are all
    /// commands of one decision. Recorders that must record each command before it is executed
    /// synchronise their storage here, once for all of them.
    fn commit(&mut self) {}

    /// Offers to rotate the record. It is called when an executive adopts a plan, before that is
    /// recorded, and while it is idle with no running action. The run can then be resumed from
    /// `stand` alone, without the earlier record. Returns `true` if the recorder has rotated.
    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        let _ = stand;
        false
    }
}

forward_port!(Recorder {
    fn record(&mut self, entry: &Entry<'_>);
    fn commit(&mut self);
    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool;
} ref {});

/// Recorder that keeps nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoRecord;

impl Recorder for NoRecord {
    fn record(&mut self, _entry: &Entry<'_>) {}
}

/// A goal without a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct UnreachedGoal {
    /// Its name.
    pub name: String,
    /// `true` if no plan reaches it, even without the other goals, as a certificate proves.
    pub is_impossible: bool,
    /// The reasons about this goal.
    pub reasons: Vec<Reason>,
}

/// One entry of a run's record. All times are on the world's clock unless stated otherwise.
#[derive(Clone, Copy, Debug)]
pub enum Entry<'a> {
    /// A plan is adopted; its times are relative to [`PreparedPlan::origin`].
    PlanAdopted(&'a PreparedPlan),
    /// A decision of the executor.
    Decided {
        /// The time.
        now: &'a Rational,
        /// The decision and its reason.
        decided: &'a Decided,
    },
    /// A command to the world.
    Command {
        /// The time.
        now: &'a Rational,
        /// The command.
        command: &'a Command,
        /// The planned window.
        planned: &'a Planned,
        /// The duration of an action in the plan, where it differs from that of the command.
        expected: Option<&'a Rational>,
        /// The time-out of an action that is started; `None` if time-outs are off.
        timeout: Option<&'a Rational>,
    },
    /// The answer to a wait: time has passed up to `now`.
    Passed {
        /// The end of the requested wait.
        until: &'a Rational,
        /// The present time.
        now: &'a Rational,
        /// The observations.
        observations: &'a [Observation],
    },
    /// The observations from the [look](crate::World::look) at the goal.
    Looked {
        /// The time.
        now: &'a Rational,
        /// The observations.
        observations: &'a [Observation],
    },
    /// An observation, and its interpretation.
    Taken {
        /// The time of the report.
        now: &'a Rational,
        /// The observation.
        observation: &'a Observation,
        /// The planned window.
        planned: &'a Planned,
        /// The objection, if the report was ignored or corrected.
        remark: Option<&'a str>,
    },
    /// A plan is being made.
    Planning {
        /// The time.
        now: &'a Rational,
        /// The reason.
        reason: &'a Reason,
        /// The initial situation of the plan.
        situation: &'a Situation,
    },
    /// The answer of the planner.
    Planned {
        /// The time, including planning time.
        now: &'a Rational,
        /// The planning time, on the world's clock.
        took: &'a Rational,
        /// The plan, on the task's clock.
        plan: Option<&'a TimeTriggeredPlan>,
        /// The reason for which there is none.
        why_not: Option<&'a str>,
        /// `true` if it is certain that there is none.
        is_unsolvable: bool,
        /// `true` if there is none because the planner has failed.
        has_failed: bool,
        /// The planner's remark.
        remark: Option<&'a str>,
        /// Known reasons for which the goals have no plan.
        shortfall: &'a Shortfall,
    },
    /// An action has used most of the time that the plan tolerates, or most of its time-out.
    Warning {
        /// The time.
        now: &'a Rational,
        /// The ticket of its start.
        ticket: ActionHandle,
        /// Its name.
        action: &'a str,
        /// The time at which a new plan is needed, or at which the action times out, unless it ends
        /// before.
        until: &'a Rational,
        /// The cause of the warning.
        cause: WarningCause,
    },
    /// The present plan continues, for one of these reasons: the goals have changed and the
    /// remaining plan also reaches the new ones; the plan was abandoned and no other one was found;
    /// or the plan that was found is no better.
    Kept {
        /// The time.
        now: &'a Rational,
        /// The change of the goals, or the reason for abandoning the plan.
        reason: &'a Reason,
    },
    /// A goal of an executive is released, closed, set aside, or pursued again.
    Goal {
        /// The time.
        now: &'a Rational,
        /// The name of the goal.
        name: &'a str,
        /// The change.
        change: GoalChange<'a>,
    },
    /// An executive is idle: it has nothing to do, or no plan, and waits for a change.
    Resting {
        /// The time.
        now: &'a Rational,
        /// The verdict on the goals; `None` if there were none.
        verdict: Option<&'a Verdict>,
        /// The names of the reached goals, or else of the open ones.
        goals: &'a [String],
        /// The parts of the goal that can never become true again, as in [`Report::dead_end`].
        dead_end: &'a [Reason],
        /// The open goals without a plan, each with the reasons about it.
        unreached: &'a [UnreachedGoal],
    },
    /// The end of the run was requested.
    Interrupted {
        /// The time.
        now: &'a Rational,
    },
    /// The world failed, but can still receive commands: running actions are cancelled.
    WorldFailed {
        /// The time.
        now: &'a Rational,
        /// The error.
        why: &'a str,
    },
    /// The run is over.
    Over(&'a Report),
}
