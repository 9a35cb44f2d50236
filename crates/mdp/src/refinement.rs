//! Bounds on finer and finer grids.

use serde::{Deserialize, Serialize};

use super::cell_probabilities::{cell_probabilities_of, step};
use super::graph;
use super::lower_bound::{DecisionEpochs, LowerBound};
use super::process::world::TimedWorld;
use super::restricted_policy::RestrictedPolicy;
use super::settings::{Grid, NotTabulated, ROUNDING_MARGIN, Settings, Side, Stop};
use super::upper_bound::UpperBound;

/// Bounds on the success probability of the best executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimedOptimum {
    /// The lower bound.
    pub lower: f64,
    /// The upper bound.
    pub upper: f64,
    /// The finished grids, coarse ones first.
    pub grids: Vec<Grid>,
    /// Reason for the end of the refinement.
    pub stop: Stop,
    /// The set of actions behind the lower bound; `None` if the lower bound is that of the finest
    /// grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<RestrictedPolicy>,
}

impl TimedOptimum {
    /// Returns the trivial bounds.
    pub(super) fn unknown() -> Self {
        Self {
            lower: 0.0,
            upper: 1.0,
            grids: Vec::new(),
            stop: Stop::Close,
            within: None,
        }
    }
}

/// Improves the bounds `known` on finer and finer grids. `is_promising` is called after each grid
/// to decide whether the refinement continues.
pub(super) fn refine_bounds(
    world: &TimedWorld,
    known: TimedOptimum,
    settings: &Settings,
    is_promising: &dyn Fn(&[Grid]) -> bool,
    may_continue: &dyn Fn() -> bool,
) -> Result<TimedOptimum, NotTabulated> {
    let mut answer = known;
    let mut cells = settings.first_cells.max(1);
    loop {
        match grid(world, cells, settings, may_continue)? {
            Ok(grid) => {
                answer.lower = answer.lower.max(grid.lower);
                answer.upper = answer.upper.min(grid.upper);
                answer.grids.push(grid);
            }
            Err(stop) => {
                answer.stop = stop;
                return Ok(answer);
            }
        }
        if answer.upper - answer.lower <= settings.gap {
            return Ok(answer);
        }
        if !is_promising(&answer.grids) {
            answer.stop = Stop::NotPromising;
            return Ok(answer);
        }
        cells *= 2;
    }
}

pub(super) fn grid(
    world: &TimedWorld,
    cells: usize,
    settings: &Settings,
    may_continue: &dyn Fn() -> bool,
) -> Result<Result<Grid, Stop>, NotTabulated> {
    if cells >= usize::from(u16::MAX) {
        return Ok(Err(Stop::FinestGrid));
    }
    let mut left = settings.most_states;
    // The lower bound first, because it detects sooner that there are too many states.
    let lower = match bound(world, (cells, Side::Below), &mut left, may_continue)? {
        Ok(value) => value,
        Err(why) => return Ok(Err(why)),
    };
    let upper = match bound(world, (cells, Side::Above), &mut left, may_continue)? {
        Ok(value) => value,
        Err(why) => return Ok(Err(why)),
    };
    Ok(Ok(Grid {
        step: step(world, cells),
        lower,
        upper,
        states: settings.most_states - left,
    }))
}

/// Computes a bound on one grid. `left` is the remaining number of states.
pub(super) fn bound(
    world: &TimedWorld,
    (cells, side): (usize, Side),
    left: &mut usize,
    may_continue: &dyn Fn() -> bool,
) -> Result<Result<f64, Stop>, NotTabulated> {
    let chances = cell_probabilities_of(world, cells, side)?;
    let world = &world.for_bound(side);
    Ok(match side {
        Side::Above => {
            let value = graph::value(&UpperBound::new(world, &chances), left, may_continue);
            value.map(|value| (value + ROUNDING_MARGIN).min(1.0))
        }
        Side::Below => {
            let below = LowerBound::new(world, &chances, DecisionEpochs::Always);
            let value = graph::value(&below, left, may_continue);
            value.map(|value| (value - ROUNDING_MARGIN).max(0.0))
        }
    })
}
