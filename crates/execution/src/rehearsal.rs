//! Port: rollouts of the possible choices in samples of the world.

use std::collections::BTreeMap;

use elbowroom_model::ground::FactId;
use elbowroom_model::{Step, Task};
use elbowroom_num::Rational;

use crate::event::Ticket;
use crate::executor::{Executor, Mission, News, StepId};
use crate::progression::Progression;

/// Compares the possible choices by rollouts: continuing the plan, handing it over to another
/// executor, making another plan, and waiting. The value of a choice is the share of samples in
/// which it reaches the goal. The samples are drawn from the distributions of a world; the future
/// of the real world is not known.
///
/// The result depends on the scene alone: no clock is read, and the random numbers are determined
/// by the scene.
pub trait Rehearsal: Send {
    /// Returns the facts whose changes are to be recorded for [`Scene::seen`].
    fn watched(&self, task: &Task) -> Vec<FactId>;

    /// Returns the events of a successful action that carry information about the world. By default
    /// all do.
    fn tells(&self, action: &str) -> Tells {
        let _ = action;
        Tells {
            by_lasting: true,
            by_ending: true,
        }
    }

    /// Returns `true` if the passage of time alone carries information about the world.
    fn tells_by_itself(&self) -> bool {
        true
    }

    /// Returns the best choice in this scene.
    fn rehearse(&mut self, scene: &Scene<'_>) -> Rehearsed;
}

/// Events of a successful action that carry information.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tells {
    /// `true` if its continued execution does: it could have ended or failed.
    pub by_lasting: bool,
    /// `true` if its end does, or its effects.
    pub by_ending: bool,
}

/// A moment of a run at which all commanded actions have started.
pub struct Scene<'a> {
    /// The believed state, at the present time.
    pub belief: &'a Progression,
    /// Changes of the [watched](Rehearsal::watched) facts until now.
    pub seen: &'a [SeenChange],
    /// The present executor, before it receives the news.
    pub present: &'a dyn Executor,
    /// The news for that executor.
    pub news: &'a [News],
    /// The tickets of its running steps.
    pub running: &'a BTreeMap<StepId, Ticket>,
    /// `true` if that executor abandons the plan now.
    pub is_given_up: bool,
    /// `true` if the plan was adopted just now.
    pub is_new: bool,
    /// The steps of the plan that have not begun, on the world's clock.
    pub left: &'a [Step],
    /// Number of new plans so far.
    pub replans: usize,
}

/// An observed change of a fact.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenChange {
    /// The time of the observation.
    pub time: Rational,
    /// The fact.
    pub fact: FactId,
    /// The truth of the fact after the change.
    pub truth: bool,
    /// `true` if the change was spontaneous.
    pub is_by_itself: bool,
}

/// The best choice, with its value.
pub struct Rehearsed {
    /// The choice.
    pub choice: Rehearsing,
    /// The share of samples where the choice reaches the goal.
    pub value: Rational,
    /// The share of samples in which the decision of the present executor reaches the goal.
    pub present: Rational,
    /// `true` if no alternatives were tried, because continuing reaches the goal in almost all
    /// samples.
    pub is_fine: bool,
}

/// A choice for a plan.
pub enum Rehearsing {
    /// The decision of its executor is carried out: it continues or abandons the plan.
    AsDecided,
    /// Another executor adopts the remaining plan.
    HandsOver(Box<dyn Executor>, Box<Mission>),
    /// Another plan is made.
    Replans,
    /// Nothing is started until then.
    WaitsUntil(Rational),
}
