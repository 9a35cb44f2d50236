//! Port: success probabilities of moves.

use std::sync::Arc;

use elbowroom_model::ground::{Action, FactId};
use elbowroom_num::Rational;

use crate::belief_state::BeliefState;

/// Computes the probability of reaching the goal in time for each move. It knows the distributions
/// of the world, but not what will happen.
///
/// Time is divided into periods of equal length. The first period begins at time 0 of the world's
/// clock. Moves are made at the beginning of a period.
pub trait ActionValues: Send + Sync {
    /// The length of a period, in seconds.
    fn period(&self) -> &Rational;

    /// Returns the possible moves at the beginning of a period, with their values. `None` if no way
    /// to the goal is known: the goal is lost, the time is beyond the horizon, or the world is not
    /// in an expected state.
    fn evaluate(&self, standing: &DecisionState<'_>) -> Option<RankedMoves>;
}

/// The situation at the beginning of a period.
#[derive(Clone, Debug)]
pub struct DecisionState<'a> {
    /// The period's number, from 0.
    pub period: usize,
    /// The believed state.
    pub belief: &'a BeliefState,
    /// The running durative actions by name, each with the period at whose beginning it is assumed
    /// to have started.
    pub running: Vec<(&'a str, usize)>,
    /// Spontaneous changes of facts, in the order of their observation.
    pub changed: &'a [(FactId, bool)],
    /// An action that is assumed to be started now.
    pub started: Option<&'a str>,
}

/// The possible moves, with their values.
#[derive(Clone, Debug)]
pub struct RankedMoves {
    /// Moves with the probability of reaching the goal in time, the best one first. Moves that
    /// cannot be best are left out. Empty if the goal can only be reached if an overdue action ends
    /// at once.
    pub moves: Vec<(Move, f64)>,
    /// `true` if a running action is overdue.
    pub is_action_overdue: bool,
}

/// A move at the beginning of a period.
#[derive(Clone, Debug, PartialEq)]
pub enum Move {
    /// Start this action, with this planned duration.
    Start(Arc<Action>, Option<Rational>),
    /// Cancel the action of this name.
    Cancel(String),
    /// Wait for the next period.
    Wait,
}

impl RankedMoves {
    /// Returns the probability of reaching the goal in time by the best move.
    pub fn best(&self) -> f64 {
        self.moves.first().map_or(0.0, |(_, value)| *value)
    }

    /// Returns the probability of reaching the goal in time by waiting for the next period; 0 if
    /// that is never best.
    pub fn value_of_waiting(&self) -> f64 {
        let mut moves = self.moves.iter();
        let found = moves.find(|(choice, _)| *choice == Move::Wait);
        found.map_or(0.0, |(_, value)| *value)
    }
}
