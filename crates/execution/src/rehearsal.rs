//! What comes of each thing that can be done, tried out in samples of the world: a port.

use std::collections::BTreeMap;

use elbowroom_model::ground::FactId;
use elbowroom_model::{Step, Task};
use elbowroom_num::Rational;

use crate::event::Ticket;
use crate::executor::{Executor, Mission, News, StepId};
use crate::progression::Progression;

/// Knows what comes of going on with a plan, of handing it to another executor, of another plan
/// and of waiting: how often each reaches the goal in samples of a world of which it knows the
/// distributions and not what will happen.
///
/// No clock is read and no dice are thrown that the scene does not determine: the same scene leads
/// to the same answer.
pub trait Rehearsal: Send {
    /// The facts whose changes are to be remembered for [`Scene::seen`].
    fn watched(&self, task: &Task) -> Vec<FactId>;

    /// What is learnt of the world when an action goes as it should. By default everything may be.
    fn tells(&self, action: &str) -> Tells {
        let _ = action;
        Tells {
            by_lasting: true,
            by_ending: true,
        }
    }

    /// Whether anything is learnt of the world by time passing alone.
    fn tells_by_itself(&self) -> bool {
        true
    }

    /// What does best from here.
    fn rehearse(&mut self, scene: &Scene<'_>) -> Rehearsed;
}

/// What is learnt when an action goes as it should.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tells {
    /// Whether anything is by its being still under way: it might have ended, or failed.
    pub by_lasting: bool,
    /// Whether anything is by its end, or by what it has changed.
    pub by_ending: bool,
}

/// A moment of a run at which all that was told to start has started.
pub struct Scene<'a> {
    /// What is believed; its time is the present.
    pub belief: &'a Progression,
    /// The changes so far of the facts that are watched.
    pub seen: &'a [SeenChange],
    /// Who executes the plan, before it is told of the news.
    pub present: &'a dyn Executor,
    /// The news, and its steps that are under way.
    pub news: &'a [News],
    /// See there.
    pub running: &'a BTreeMap<StepId, Ticket>,
    /// Whether it gives the plan up now.
    pub is_given_up: bool,
    /// Whether the plan was taken up just now.
    pub is_new: bool,
    /// What of the plan was not begun, by the world's clock.
    pub left: &'a [Step],
    /// How many new plans there have been.
    pub replans: usize,
}

/// A change of a fact that was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenChange {
    /// When it was seen.
    pub time: Rational,
    /// Of which fact.
    pub fact: FactId,
    /// What it is from then on.
    pub truth: bool,
    /// Whether the world has made it by itself.
    pub is_by_itself: bool,
}

/// What does best, and how well.
pub struct Rehearsed {
    /// What to do.
    pub choice: Rehearsing,
    /// The share of samples in which the goal is reached by it.
    pub value: Rational,
    /// The same of what would be done without any choice.
    pub present: Rational,
    /// Whether nothing else was tried out, because going on reaches the goal in next to all samples.
    pub is_fine: bool,
}

/// Something that can be done with a plan.
pub enum Rehearsing {
    /// What its executor says: to go on, or to give it up.
    AsDecided,
    /// Another executor takes up what is left of it.
    HandsOver(Box<dyn Executor>, Box<Mission>),
    /// Another plan is made.
    Replans,
    /// Nothing is begun until then.
    WaitsUntil(Rational),
}
