//! Port: rollouts of the possible choices in samples of the world.

use std::collections::BTreeMap;

use elbowroom_model::ground::FactId;
use elbowroom_model::{Step, Task};
use elbowroom_num::Rational;

use crate::belief_state::BeliefState;
use crate::event::ActionHandle;
use crate::executor::{Executor, PlanEvent, PreparedPlan, StepId};

/// Compares the possible choices by rollouts: continuing the plan, handing it over to another
/// executor, making another plan, and waiting. The value of a choice is the share of samples in
/// which it reaches the goal. The samples are drawn from the distributions of a world; the future
/// of the real world is not known.
///
/// The result depends on the scene alone: no clock is read, and the random numbers are determined
/// by the scene.
pub trait RolloutEvaluator: Send {
    /// Returns the facts whose changes are to be recorded for [`Scene::seen`].
    fn watched_facts(&self, task: &Task) -> Vec<FactId>;

    /// Returns the events of a successful action that carry information about the world. By default
    /// all do.
    fn informativeness(&self, action: &str) -> Informativeness {
        let _ = action;
        Informativeness {
            while_running: true,
            on_end: true,
        }
    }

    /// Returns `true` if the passage of time alone carries information about the world.
    fn is_time_informative(&self) -> bool {
        true
    }

    /// Returns the best choice in this scene.
    fn evaluate(&mut self, scene: &DecisionPoint<'_>) -> RolloutResult;
}

/// Events of a successful action that carry information.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Informativeness {
    /// `true` if its continued execution does: it could have ended or failed.
    pub while_running: bool,
    /// `true` if its end does, or its effects.
    pub on_end: bool,
}

/// A moment of a run at which all commanded actions have started.
pub struct DecisionPoint<'a> {
    /// The believed state, at the present time.
    pub belief: &'a BeliefState,
    /// Changes of the [watched](Rehearsal::watched) facts until now.
    pub observed_changes: &'a [ObservedChange],
    /// The present executor, before it receives the news.
    pub executor: &'a dyn Executor,
    /// The news for that executor.
    pub plan_events: &'a [PlanEvent],
    /// The tickets of its running steps.
    pub running: &'a BTreeMap<StepId, ActionHandle>,
    /// `true` if that executor abandons the plan now.
    pub is_plan_abandoned: bool,
    /// `true` if the plan was adopted just now.
    pub is_plan_new: bool,
    /// The steps of the plan that have not begun, on the world's clock.
    pub remaining_steps: &'a [Step],
    /// Number of new plans so far.
    pub replans: usize,
}

/// An observed change of a fact.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservedChange {
    /// The time of the observation.
    pub time: Rational,
    /// The fact.
    pub fact: FactId,
    /// The truth of the fact after the change.
    pub truth: bool,
    /// `true` if the change was spontaneous.
    pub is_spontaneous: bool,
}

/// The best choice, with its value.
pub struct RolloutResult {
    /// The choice.
    pub choice: RolloutChoice,
    /// The share of samples where the choice reaches the goal.
    pub value: Rational,
    /// The share of samples in which the decision of the present executor reaches the goal.
    pub executor_value: Rational,
    /// `true` if no alternatives were tried, because continuing reaches the goal in almost all
    /// samples.
    pub are_alternatives_skipped: bool,
}

/// A choice for a plan.
pub enum RolloutChoice {
    /// The decision of its executor is carried out: it continues or abandons the plan.
    FollowExecutor,
    /// Another executor adopts the remaining plan.
    HandOver(Box<dyn Executor>, Box<PreparedPlan>),
    /// Another plan is made.
    Replan,
    /// Nothing is started until then.
    WaitUntil(Rational),
}
