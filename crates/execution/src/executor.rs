//! Port: decision making during a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Change, FactId, FluentId};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, InstanceId, ParametrizedPlan, PartialOrderPlan, Schedule};

use crate::belief_state::BeliefState;
use crate::dispatchable_cache::DispatchableCache;
use crate::event::{ActionHandle, Ending, Measured};
use crate::reason::Reason;

/// The form of a plan that an executor requires, from the least to the most preparation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanForm {
    /// The orderings that facts require. There are no open parameters, and numeric conditions are
    /// not guaranteed. This is the information of `ROSPlan`'s dispatcher.
    Orderings,
    /// The orderings, and the partial order of the plan's happenings, whose layers can be executed
    /// in more than one order.
    PartialOrder,
    /// The orderings, with enough fixed differences of times that every schedule works.
    Network,
    /// The network with open parameters, and the envelope of their values if it can be computed.
    OpenNetwork,
    /// The network with open parameters and their envelope, which is required.
    Envelope,
}

/// Identifier of an action of the present plan, chosen by the executor.
///
/// An action that is running when a plan is adopted ([`PreparedPlan::running`]) has the number of its
/// instance in [`PreparedPlan::plan`]. Executors that execute that plan number all steps this way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StepId(pub u32);

impl From<InstanceId> for StepId {
    fn from(id: InstanceId) -> Self {
        Self(id.0)
    }
}

impl StepId {
    /// Returns the instance, for executors that number steps by the instances of their plan.
    pub fn instance(self) -> InstanceId {
        InstanceId(self.0)
    }
}

/// Makes the decisions of a run. Implementations use no clock, no input or output and no
/// randomness: the same history leads to the same decisions.
pub trait Executor: Send {
    /// Returns the form of a plan that it requires.
    fn need(&self) -> PlanForm;

    /// Adopts a plan, and forgets the previous one.
    ///
    /// # Errors
    /// The reason for which the plan cannot be executed (any more).
    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>>;

    /// Returns the next decision. The run calls this again until the decision is
    /// [`Decision::Wait`]. Each news item is passed only once.
    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided;

    /// Returns `true` if the plan that it last abandoned ([`Decision::Replan`]) has a fair chance
    /// to work, so that it is better to [carry on](Executor::carry_on) than to cancel overdue
    /// actions.
    fn may_carry_on(&self) -> bool {
        false
    }

    /// Continues with that plan, without any guarantee, because no other one was found. Returns
    /// `false` if it does not.
    fn carry_on(&mut self, _now: &Rational) -> bool {
        false
    }

    /// Returns `true` if a better plan is to be searched for while the present one is executed.
    /// Called before each wait. The answer is `true` once for each loss of guarantee, and after
    /// each end without any guarantee.
    fn seeks_better_plan(&mut self, _now: &Rational) -> bool {
        false
    }

    /// Returns `true` if this plan is better than the remaining present plan.
    fn prefers_plan(&self, _mission: &PreparedPlan, _now: &Rational) -> bool {
        false
    }

    /// Returns the present window of a step's start or end for the record, on the world's clock.
    fn window(&self, _step: StepId, _is_end: bool) -> Option<Planned> {
        None
    }

    /// Returns the latest end of a running step with which no new plan is needed if nothing else
    /// deviates, on the world's clock, as far as it can be computed. `None` if only the step's
    /// window is known.
    fn latest_tolerated_end(&self, _step: StepId, _now: &Rational) -> Option<Rational> {
        None
    }

    /// Returns a copy of the executor in its present state, which makes the same decisions.
    /// Rollouts use it to simulate the remaining run. `None` if the executor cannot be copied.
    fn fork(&self) -> Option<Box<dyn Executor>> {
        None
    }
}

/// The time window of a happening.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planned {
    /// The earliest time; `None` if there is no lower bound.
    pub earliest: Option<Rational>,
    /// The latest time; `None` if there is no upper bound.
    pub latest: Option<Rational>,
}

/// A plan prepared for execution.
#[derive(Clone, Debug)]
pub struct PreparedPlan {
    /// The remaining task, with its own clock.
    pub task: Arc<Task>,
    /// The time on the world's clock when the task's clock reads 0.
    pub origin: Rational,
    /// The present time on the world's clock; the plan cannot begin earlier.
    pub now: Rational,
    /// The planner's plan, on the task's clock.
    pub time_triggered: TimeTriggeredPlan,
    /// The deordered plan, with open parameters.
    pub plan: ParametrizedPlan,
    /// For each step of `time_triggered`, its instance in `plan`.
    pub instances: Vec<InstanceId>,
    /// The time of each event if nothing deviates, on the task's clock.
    pub nominal: Schedule,
    /// The values of the open parameters for which the plan is guaranteed to work.
    pub envelope: Option<DecoupledEnvelope>,
    /// Cache of the dispatchable forms of the plan's networks.
    pub dispatchable_cache: DispatchableCache,
    /// The partial order of the plan's happenings, for executors that need it
    /// ([`PlanForm::PartialOrder`]).
    pub order: Option<PartialOrderPlan>,
    /// The running actions, which continue in the plan: see [`StepId`].
    pub running: BTreeMap<StepId, ActionHandle>,
    /// Other steps of the plan that have begun between the plan's start time and its adoption.
    /// Their starts and ends are reported to the executor as news.
    pub begun: BTreeMap<StepId, ActionHandle>,
}

/// Input of a decision.
#[derive(Clone, Copy, Debug)]
pub struct DecisionContext<'a> {
    /// The present time, by the world's clock.
    pub now: &'a Rational,
    /// The observations since the last decision.
    pub plan_events: &'a [PlanEvent],
    /// The believed state.
    pub belief: &'a BeliefState,
}

/// Checked observation that concerns the present plan. Each start and end is reported once.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanEvent {
    /// An action has started.
    Started {
        /// The step of the plan.
        step: StepId,
        /// The time.
        time: Rational,
        /// Amounts measured.
        measured: Vec<Amount>,
    },
    /// An action has ended.
    Ended {
        /// The step of the plan.
        step: StepId,
        /// The time.
        time: Rational,
        /// The outcome.
        ending: Ending,
        /// Amounts measured.
        measured: Vec<Amount>,
    },
    /// A fact is not as believed.
    Fact(FactId),
    /// A value is not as believed.
    Value(FluentId),
    /// Reports on an action contradict each other.
    Contradiction {
        /// The action.
        action: String,
    },
    /// An action has timed out.
    TimedOut {
        /// The action.
        action: String,
        /// The time at which it should have ended.
        since: Rational,
    },
}

impl PlanEvent {
    /// Returns a change as news.
    pub(crate) fn from_change(change: &Change) -> Self {
        match change {
            Change::Add(fact) | Change::Delete(fact) => Self::Fact(*fact),
            Change::Update { fluent, .. } => Self::Value(*fluent),
        }
    }
}

/// A measured amount, with the inputs of the domain's expression for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Amount {
    /// The measured quantity.
    pub measured: Measured,
    /// The value of `?duration`: the action's actual duration, or, at its start, the planned one.
    pub duration: Option<Rational>,
    /// The values of the fluents in the expression before the effect.
    pub values: Vec<(FluentId, Rational)>,
}

/// A decision with its reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Decided {
    /// The decision.
    pub decision: Decision,
    /// The reason.
    pub reason: Reason,
}

/// A decision of an executor.
#[derive(Clone, Debug, PartialEq)]
pub enum Decision {
    /// Start these actions now.
    Start(Vec<Order>),
    /// Wait until `until`, or until the next observation if that is earlier; `None` for no limit.
    Wait {
        /// On the world's clock.
        until: Option<Rational>,
    },
    /// Cancel these steps.
    Cancel(Vec<StepId>),
    /// Abandon the plan, and request another one.
    Replan,
    /// The goal is reached.
    GoalReached,
}

/// An action to start.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The identifier for news.
    pub step: StepId,
    /// The action.
    pub action: Arc<Action>,
    /// The planned duration; `None` for an instantaneous action.
    pub duration: Option<Rational>,
    /// The window of its start.
    pub planned: Planned,
}

impl Decision {
    /// Returns the name used in traces.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Start(_) => "start",
            Self::Wait { .. } => "wait",
            Self::Cancel(_) => "cancel",
            Self::Replan => "replan",
            Self::GoalReached => "goal-reached",
        }
    }
}
