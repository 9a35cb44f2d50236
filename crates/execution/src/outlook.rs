//! What can be reached in time from where one stands, and by what: a port.

use std::sync::Arc;

use elbowroom_model::ground::{Action, FactId};
use elbowroom_num::Rational;

use crate::progression::Progression;

/// Knows the probability to reach the goal in time, move by move, in a world of which it knows the
/// distributions and not what will happen.
///
/// It reckons in periods of one length, the first of which begins at time 0 of the world's clock;
/// moves are made at their beginnings.
pub trait Outlook: Send + Sync {
    /// The length of a period, in seconds.
    fn period(&self) -> &Rational;

    /// What can be done at the beginning of a period, and what each move is worth. `None` where
    /// nothing is known to lead to the goal: it is lost, later than anything that is known, or the
    /// world is not the one that was expected.
    fn weigh(&self, standing: &Standing<'_>) -> Option<Weighed>;
}

/// How things stand at the beginning of a period.
#[derive(Clone, Debug)]
pub struct Standing<'a> {
    /// The period's number, from 0.
    pub period: usize,
    /// What holds.
    pub belief: &'a Progression,
    /// The durative actions under way by name, each with the period at whose beginning it counts as
    /// started.
    pub running: Vec<(&'a str, usize)>,
    /// The facts that the world has changed by itself, in the order in which that was seen.
    pub changed: &'a [(FactId, bool)],
    /// An action that is thought of as started now.
    pub started: Option<&'a str>,
}

/// The moves that can be made, and what they are worth.
#[derive(Clone, Debug)]
pub struct Weighed {
    /// Each with the probability to reach the goal in time by it; the best one first, and only such
    /// as may be best. None if nothing leads to the goal unless what is overdue ends at once.
    pub moves: Vec<(Move, f64)>,
    /// Whether something under way should be over by now.
    pub is_overdue: bool,
}

/// Something that can be done at the beginning of a period.
#[derive(Clone, Debug, PartialEq)]
pub enum Move {
    /// To start this action, planned to take that long.
    Start(Arc<Action>, Option<Rational>),
    /// To let the action of that name go.
    Cancel(String),
    /// To do nothing until the next period.
    Wait,
}

impl Weighed {
    /// The probability to reach the goal in time by the best move.
    pub fn best(&self) -> f64 {
        self.moves.first().map_or(0.0, |(_, value)| *value)
    }

    /// The same by waiting for the next period; 0 where it is never best to.
    pub fn by_waiting(&self) -> f64 {
        let mut moves = self.moves.iter();
        let found = moves.find(|(choice, _)| *choice == Move::Wait);
        found.map_or(0.0, |(_, value)| *value)
    }
}
