//! Reference values: the probability that an optimal executor reaches the goal in a small world.
//!
//! [`Perturbed`] is a Markov decision process. A state consists of the truth values of all facts
//! and the set of running actions. The agent has these moves:
//!
//! - *Start* an action that is not running and whose condition holds. With the action's success
//!   probability, it is then running and its start effects take place, each with its own
//!   probability, deletions first. Otherwise nothing happens.
//! - *End* a running action whose end condition holds. With the probability of its end, its end
//!   effects take place likewise. Otherwise it has failed, none of them takes place, and facts
//!   change by one of the outcomes of its failure ([`FailureOutcome`](crate::likelihoods::FailureOutcome)).
//!   In both cases, it is no longer running. Instantaneous actions are tried like starts, and are
//!   not running afterwards.
//! - *Abandon* a running action: its end effects will not take place. This is not a step.
//!
//! After each start and each end, successful or not, every fact may change by itself, once and
//! independently of the others ([`Semantics::World`](crate::Semantics)). Then the agent observes
//! the state. It stops with success when the goal holds and no action is running.
//!
//! There is no time in this world: no durations, deadlines or waiting, as in the authors'
//! simulation. Over-all conditions are ignored, as there ([`Settings::enforces_over_all`] changes
//! that).
//!
//! A run is limited by its number of steps ([`Horizon`]). The experiments limit planning rounds
//! instead: a run is over when no plan is found a given number of times. [`DeadEnds`] is the
//! corresponding rule here. If facts can be restored by spontaneous changes, such a rule is needed:
//! without it, any agent that performs arbitrary steps for long enough succeeds with certainty.

mod process;
mod reachable;
mod small_world;
mod table;
mod value_iteration;

use elbowroom_model::State;
use elbowroom_plan::{InstanceId, NodeId};

use crate::dispatch::{Choice, NextHappening, goal_holds};
use crate::search_state::SearchState;
use crate::total_order::Slot;

pub use process::Perturbed;
pub use reachable::{ValueBounds, value_bounds};
pub use small_world::{PolicyTable, best_value};

/// Limit on the number of steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Horizon {
    /// At most this number of steps.
    Steps(usize),
    /// No limit.
    Unlimited,
}

/// Rule for a run in a dead end: a state where the goal is unreachable even without further
/// failures, so that a planner finds no plan. Only spontaneous changes lead out of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeadEnds {
    /// The run continues.
    Harmless,
    /// The run is lost.
    Lost,
    /// The run continues until this number of its steps have ended in a dead end; the last of them
    /// is lost. At least 1.
    Patience(usize),
}

/// Rules of the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The limit on the number of steps of a run.
    pub horizon: Horizon,
    /// Largest number of actions that run at once.
    pub most_running: usize,
    /// Rule for a run without a plan.
    pub dead_ends: DeadEnds,
    /// `true` if an action whose over-all condition fails is abandoned at once.
    pub enforces_over_all: bool,
}

impl Default for Settings {
    /// Returns the rules of the experiments, without a limit on running actions.
    fn default() -> Self {
        Self {
            horizon: Horizon::Unlimited,
            most_running: usize::MAX,
            dead_ends: DeadEnds::Lost,
            enforces_over_all: false,
        }
    }
}

/// Reason why the world cannot be tabulated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TabulationError {
    /// Too many states.
    #[error("{facts} facts and {actions} actions have too many states to tabulate")]
    TooManyStates {
        /// Number of relevant facts.
        facts: usize,
        /// Number of actions.
        actions: usize,
    },
    /// Too many actions.
    #[error("the optimum does not support {actions} actions")]
    TooManyActions {
        /// Number of actions.
        actions: usize,
    },
    /// Numbers, or effects that depend on over-all conditions.
    #[error("the optimum does not support worlds in which {what}")]
    Unsupported {
        /// The unsupported feature.
        what: String,
    },
    /// The model has the paper's semantics.
    #[error("the model must be one of a world, not of the paper's network")]
    PaperSemantics,
}

/// A move of an agent in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Move {
    /// Tries a start or an instantaneous action, or ends an action; a node of the plan.
    Try(NodeId),
    /// Abandons an action.
    Abandon(InstanceId),
    /// Stops.
    Stop,
}

/// Values of all states under an optimal policy, and the moves of the policy.
#[derive(Clone, Debug)]
pub struct Optimum {
    values: value_iteration::Values,
    moves: Vec<Vec<Vec<Move>>>,
    /// Number of sweeps.
    pub sweeps: usize,
}

impl Optimum {
    /// Returns the best choice from here, as an executor's decision; `slot` returns the time window
    /// of a happening.
    pub fn choice(
        &self,
        process: &Perturbed,
        circumstances: &SearchState,
        slot: impl FnOnce(NodeId) -> Slot,
    ) -> Choice {
        if circumstances.running.is_empty() && goal_holds(process.model(), circumstances) {
            return Choice::GoalReached;
        }
        match self.choose(process, circumstances) {
            Move::Try(node) => Choice::Next(NextHappening {
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

    /// Returns the greatest probability of success from here, in [0, 1], with full patience.
    ///
    /// With [`Horizon::Unlimited`], it is approximated from below; the sweeps stop when none of
    /// them adds more than 1e-12 to any state.
    pub fn value(&self, process: &Perturbed, circumstances: &SearchState) -> f64 {
        let values = self.values.last().map_or(&[][..], Vec::as_slice);
        process
            .weights(circumstances)
            .into_iter()
            .map(|(set, state, weight)| weight * values[set][state])
            .sum()
    }

    /// Returns the best move, with all steps of the horizon and full patience remaining.
    ///
    /// For an uncertain belief, the most likely state is used.
    pub fn choose(&self, process: &Perturbed, circumstances: &SearchState) -> Move {
        let mut weights = process.weights(circumstances);
        weights.sort_by(|(.., a), (.., b)| b.total_cmp(a));
        let likeliest = weights.first();
        let moves = self.moves.last();
        likeliest
            .zip(moves)
            .map_or(Move::Stop, |((set, state, _), moves)| moves[*set][*state])
    }

    /// Returns the best move in a known state, when `patience` more steps may end in a dead end
    /// ([`DeadEnds::Patience`]; 0: the next one that does is the last).
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
