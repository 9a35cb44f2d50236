//! Limits of the computation, and the terms of its results.

use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

/// Limits of the computation.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The difference of the bounds at which the computation stops.
    pub gap: f64,
    /// Maximum number of states of a grid, all cells together.
    pub most_states: usize,
    /// Number of cells of the first grid.
    pub first_cells: usize,
    /// Latest end of a run; `None` for the time of the last event.
    pub horizon: Option<Rational>,
    /// The available actions, `(name object …)`; `None` for all.
    pub only: Option<Vec<String>>,
    /// Sets of actions, such as those of plans. An agent that uses only one of these sets is no
    /// better than the best, but its bound needs fewer states.
    pub plans: Vec<Vec<String>>,
    /// Further sets of actions: those of new plans after a failure of one of the
    /// [plans](Self::plans), with the supporting actions of that plan ([`supported`](crate::supported)). They are
    /// used only if everything happens at known times, after the plans.
    pub fallbacks: Vec<Vec<String>>,
}

impl Default for Settings {
    /// A difference of one percentage point; some seconds.
    fn default() -> Self {
        Self {
            gap: 0.01,
            most_states: 2_000_000,
            first_cells: 32,
            horizon: None,
            only: None,
            plans: Vec::new(),
            fallbacks: Vec::new(),
        }
    }
}

/// Reasons for the end of the refinement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The bounds are close enough.
    Close,
    /// The next grid has too many states.
    TooManyStates,
    /// No finer grid is supported, or would bring the bounds closer.
    FinestGrid,
    /// The bounds are not expected to become close within the limits.
    NotPromising,
    /// The caller stopped it.
    Interrupted,
}

/// The bounds of one grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The length of a cell, in seconds.
    pub step: f64,
    /// The lower bound.
    pub lower: f64,
    /// The upper bound.
    pub upper: f64,
    /// Number of states at the beginnings of cells, for both bounds together.
    pub states: usize,
}

/// Direction of a bound on the best value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// A lower bound.
    Below,
    /// An upper bound.
    Above,
}

/// The task or the world has features without a timed optimum.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; the optimum without foresight does not support this")]
pub struct NotTabulated {
    /// The unsupported feature.
    pub what: String,
}

impl NotTabulated {
    pub(crate) fn new(what: impl Into<String>) -> Self {
        Self { what: what.into() }
    }
}

/// Widening of the bounds, far above rounding errors.
pub(crate) const ROUNDING_MARGIN: f64 = 1e-9;
