//! Snapshots of an executive, from which it can be resumed.

use elbowroom_model::{Situation, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::action_log::KnownStart;
use super::goals::{GivenGoal, Goals};
use super::refusal_backoff::RefusalBackoff;
use crate::belief_state::BeliefState;
use crate::event::ActionHandle;
use crate::executor::PlanEvent;

/// Snapshot of an executive that adopts a plan, or is idle with no action running.
#[derive(Clone, Debug)]
pub struct RunSnapshot {
    /// The belief, at the present time.
    pub belief: BeliefState,
    /// Number of actions started, which is the next ticket.
    pub started: usize,
    /// The running actions, and the last ones that have ended. All other starts ended long ago.
    pub starts: Vec<KnownStart>,
    /// Expected planning time, in seconds of the world's clock.
    pub allowance: Rational,
    /// The time from when answers of the world are counted, and their number, to detect a clock
    /// that stands still ([`Verdict::WorldFailed`](crate::run::Verdict::WorldFailed)).
    pub answers: (Rational, usize),
    /// Number of new plans since the run was last idle.
    pub replans: usize,
    /// Actions refused by the world since the last other event.
    pub refusals: RefusalBackoff,
    /// The open goals.
    pub goals: Goals,
    /// The goals whose release times have not come, and the goals to keep that are not pursued.
    pub queued: Vec<GivenGoal>,
    /// `true` if the run is paused.
    pub is_paused: bool,
    /// The state of the run.
    pub phase: RunPhase,
}

/// State of a run at a snapshot.
#[derive(Clone, Debug)]
pub enum RunPhase {
    /// It is idle.
    Idle {
        /// Start of the idle state.
        since: Rational,
        /// `true` if it is proved that no plan reaches the open goals from there.
        is_unsolvable: bool,
    },
    /// It adopts a plan.
    Adopting(Box<PlanAdoption>),
}

/// A plan that is being adopted.
#[derive(Clone, Debug)]
pub struct PlanAdoption {
    /// The plan, on the world's clock.
    pub plan: TimeTriggeredPlan,
    /// The situation from which the plan starts.
    pub situation: Situation,
    /// The tickets of the actions that are running there, in its order.
    pub running: Vec<ActionHandle>,
    /// The steps of the plan that have begun since.
    pub begun_steps: Vec<ActionHandle>,
    /// The goals of the plan.
    pub goals: Goals,
    /// Events that the plan does not account for.
    pub plan_events: Vec<PlanEvent>,
    /// The change of the goals since the plan was requested, in words, and `true` if goals were
    /// only added. `None` if they have not changed.
    pub pending_goal_change: Option<(String, bool)>,
}
