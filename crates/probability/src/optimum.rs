//! The yardstick: how likely the best of all executors is to reach the goal in a small world.
//!
//! [`Perturbed`] is a Markov decision process. A state is the truth of all facts and the set of
//! actions under way. What the agent can do, and what then happens:
//!
//! - *Try to start* an action that is not under way and whose condition holds. With the action's
//!   success probability it is then under way and its start effects take place, each with its own
//!   probability, deletions first; else nothing happens.
//! - *End* an action under way whose end condition holds. With the probability of its end, its end
//!   effects take place likewise; else it has failed, none of them takes place, and facts are as
//!   one of its failure's outcomes leaves them
//!   ([`Aftermath`](crate::likelihoods::Aftermath)). Either way it is no longer under way.
//!   Instantaneous actions are tried like starts and leave nothing under way.
//! - *Abandon* an action under way: its end effects will not take place. That takes no step.
//!
//! After each try and each end, successful or not, every fact may change by itself, once and
//! independently of the others ([`Semantics::World`](crate::Semantics)). Then the agent sees the
//! state as it is. It stops, with success, when it sees the goal hold with nothing under way.
//!
//! There is no time in this world: durations, deadlines and waiting do not exist, as in the
//! authors' simulation. What is required throughout an action is, as there, not looked at
//! ([`Settings::enforces_over_all`] changes that).
//!
//! The number that limits a run is that of its steps ([`Horizon`]). The experiments limit planning
//! rounds instead: a run is over when no plan is found so many times. [`DeadEnds`] says what that
//! means here. Where broken things can mend themselves, such a rule is needed, because otherwise
//! whoever does something, no matter what, for long enough succeeds for certain.

mod process;
mod small_world;
mod sweeps;
mod table;

use elbowroom_model::State;
use elbowroom_plan::{InstanceId, NodeId};

use crate::circumstances::Circumstances;
use crate::dispatch::{Choice, NextHappening, goal_holds};
use crate::total_order::Slot;

pub use process::Perturbed;
pub use small_world::{Table, best_value};

/// The number of steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Horizon {
    /// At most this many.
    Steps(usize),
    /// As many as it takes.
    Unlimited,
}

/// What becomes of a run in a dead end: where the goal could not be reached even if nothing went
/// wrong any more, so that who plans does not find a plan. Only luck leads out of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeadEnds {
    /// It goes on.
    Harmless,
    /// It is lost.
    Lost,
    /// It goes on, until so many of its steps have ended in one; that one is the last. At least 1.
    Patience(usize),
}

/// The rules of the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The limit on the number of steps of a run.
    pub horizon: Horizon,
    /// The number of actions that can be under way at once.
    pub most_running: usize,
    /// The outcome of a run where there is no plan.
    pub dead_ends: DeadEnds,
    /// Whether an action whose over-all condition fails is abandoned at once.
    pub enforces_over_all: bool,
}

impl Default for Settings {
    /// The rules of the experiments, without a limit on what is under way.
    fn default() -> Self {
        Self {
            horizon: Horizon::Unlimited,
            most_running: usize::MAX,
            dead_ends: DeadEnds::Lost,
            enforces_over_all: false,
        }
    }
}

/// The world is not one that can be tabulated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotSmall {
    /// Too many states.
    #[error("{facts} facts and {actions} actions make more states than can be tabulated")]
    TooManyStates {
        /// How many facts matter.
        facts: usize,
        /// The number of actions.
        actions: usize,
    },
    /// Numbers, or effects that depend on what held throughout an action.
    #[error("{what}, and such worlds are not tabulated")]
    Unsupported {
        /// The unsupported feature.
        what: String,
    },
    /// The likelihoods are those of another reading.
    #[error("the model must be one of a world, not of the paper's network")]
    PaperSemantics,
}

/// An agent's action in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Move {
    /// Tries a start or an instantaneous action, or ends an action: a node of the plan.
    Do(NodeId),
    /// Lets an action go.
    Abandon(InstanceId),
    /// Does nothing any more.
    Stop,
}

/// The value of each state for the best of all agents, and what it does there.
#[derive(Clone, Debug)]
pub struct Optimum {
    values: sweeps::Values,
    moves: Vec<Vec<Vec<Move>>>,
    /// How many sweeps it took.
    pub sweeps: usize,
}

impl Optimum {
    /// The best choice from here, in the form of an executor's decision; `slot` says when a
    /// happening can take place.
    pub fn choice(
        &self,
        process: &Perturbed,
        circumstances: &Circumstances,
        slot: impl FnOnce(NodeId) -> Slot,
    ) -> Choice {
        if circumstances.running.is_empty() && goal_holds(process.model(), circumstances) {
            return Choice::GoalReached;
        }
        match self.choose(process, circumstances) {
            Move::Do(node) => Choice::Next(NextHappening {
                node,
                position: 0,
                together: Vec::new(),
                slot: slot(node),
                is_new_order: false,
            }),
            Move::Abandon(id) => Choice::Abandon(id),
            Move::Stop => Choice::Replan,
        }
    }

    /// The greatest probability of success from here, in [0, 1], with all patience left.
    ///
    /// With [`Horizon::Unlimited`] it is approached from below; the sweeps stop when none of them
    /// adds more than 1e-12 to any state.
    pub fn value(&self, process: &Perturbed, circumstances: &Circumstances) -> f64 {
        let values = self.values.last().map_or(&[][..], Vec::as_slice);
        process
            .weights(circumstances)
            .into_iter()
            .map(|(set, state, weight)| weight * values[set][state])
            .sum()
    }

    /// What to do, with all steps of the horizon and all patience still to come.
    ///
    /// Of an uncertain belief, the most likely state counts.
    pub fn choose(&self, process: &Perturbed, circumstances: &Circumstances) -> Move {
        let mut weights = process.weights(circumstances);
        weights.sort_by(|(.., a), (.., b)| b.total_cmp(a));
        let likeliest = weights.first();
        let moves = self.moves.last();
        likeliest
            .zip(moves)
            .map_or(Move::Stop, |((set, state, _), moves)| moves[*set][*state])
    }

    /// What to do where everything is known, and when `patience` more steps may end in a dead end
    /// ([`DeadEnds::Patience`]; 0: none, the next that does is the last).
    pub fn choose_at(
        &self,
        process: &Perturbed,
        state: &State,
        running: &[InstanceId],
        patience: usize,
    ) -> Move {
        let moves = self.moves.get(patience).or_else(|| self.moves.last());
        let place = process.place(state, running);
        place
            .zip(moves)
            .map_or(Move::Stop, |((set, state), moves)| moves[set][state])
    }
}
