//! Bounds on the success probability of the best executor without foresight, in a world on a clock
//! with known distributions.
//!
//! The world is a semi-Markov decision process. Its state consists of the truth of all facts, the
//! running actions with their elapsed times, the past events, and the clock. The agent observes the
//! state. At any time it may start an action whose condition holds, cancel a running action, or
//! wait. It does not observe the future: the duration of an action, its failure and the failure's
//! outcome, and the times of events are drawn from the world file's distributions, conditioned on
//! the observations. It succeeds as soon as the goal holds. All actions of the problem are
//! available at any time, and deciding takes no time, so no executor succeeds more often, whatever
//! its planner.
//!
//! **Numbers.** For a number that actions change, the state contains an interval of its values
//! (`process::value_intervals`). A comparison is an additional fact. In the upper bound it holds if some of the
//! values satisfy it, in the lower bound if all do. Drawn values are divided into intervals where
//! they decide a comparison.
//!
//! The process ignores ε: interfering happenings may be arbitrarily close, and simultaneous
//! happenings take place one after the other. The agent also does not observe whether an action has
//! already failed and can no longer be cancelled. The lower bound never cancels an action that may
//! be in this state, and counts the goal when the action is over; the upper bound can always
//! cancel. A start that fails costs no time and can be retried at once.
//!
//! **Bounds.** The best value is bounded from both sides on a grid of time: cells of one length.
//!
//! - *Above*, `Side::Above`: at the beginning of a cell, the agent learns which actions end and
//!   which events happen in it, and chooses their order within the cell. An action that starts in
//!   cell c and takes between n and n + 1 cells ends in cell c + n or in the next one; the agent
//!   also chooses between these. This agent can imitate any agent of the real process step by step,
//!   with the remainders drawn at random, so its value is at least the best.
//! - *Below*, `Side::Below`: the agent decides only at the boundaries of cells, and the happenings
//!   between them have the worst order. This is a policy of the real process, so its value is at
//!   most the best.
//!
//! Neither bound assumes that an earlier happening is never harmful. If it is never harmful (no
//! condition requires a fact to be false), fewer cases are examined.
//!
//! If everything happens at known times, there is no grid: states exist only when something happens
//! or becomes ready to happen (`discrete_events`).
//!
//! If plans are known, a further lower bound is that of an agent that uses only the actions of one
//! of them and acts only after a happening (`restricted_policy`). It needs far fewer states.
//!
//! The cells are halved until the bounds are close enough, or there are too many states. If more
//! facts are never harmful, the upper bound is then computed on finer grids of a *kinder* world
//! (`relaxed_world`), without events at random times that only delete facts. It has fewer states, and
//! every agent succeeds in it at least as often. Probabilities are floating-point numbers; the
//! bounds are widened by 1e-9, which is far more than the rounding errors.

mod action_subsets;
mod cell_probabilities;
mod discrete_events;
mod graph;
mod lower_bound;
mod policy;
pub mod process;
mod projection;
mod relaxed_world;
mod restricted_policy;
mod state;
mod upper_bound;

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

pub use action_subsets::supported;
pub use cell_probabilities::{CellProbabilities, EndProbabilities};
pub use policy::Policy;
pub use restricted_policy::RestrictedPolicy;

use process::world::TimedWorld;

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
    /// [plans](Self::plans), with the supporting actions of that plan ([`supported`]). They are
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
    /// The caller stopped it.
    Interrupted,
}

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
    fn new(what: impl Into<String>) -> Self {
        Self { what: what.into() }
    }
}

/// Bounds the success probability of the best executor without foresight.
///
/// `goes_on` is called regularly; if it returns `false`, the answer contains the bounds found so
/// far.
///
/// # Errors
/// When the task or the world has a feature that the process does not support.
pub fn optimum(
    task: &Task,
    model: &WorldModel,
    settings: &Settings,
    goes_on: &dyn Fn() -> bool,
) -> Result<TimedOptimum, NotTabulated> {
    let world = TimedWorld::new(task, model, settings);
    let horizon = world.as_ref().ok().map(|world| world.horizon);
    let mut search = restricted_policy::Search::new(task, model, settings, horizon);
    search.refine(
        1.0,
        settings.most_states / FIRST_STATES_DIVISOR,
        settings,
        goes_on,
    );
    if search.best.is_some() && 1.0 - search.lower() <= settings.gap {
        return Ok(TimedOptimum {
            lower: search.lower(),
            within: search.best,
            ..TimedOptimum::unknown()
        });
    }
    let world = world?;
    let mut known = TimedOptimum {
        lower: search.lower(),
        ..TimedOptimum::unknown()
    };
    if let Some(found) =
        discrete_events::bounds(&world, settings, discrete_events::Effort::WHOLE, goes_on)?
    {
        let grid = found.grid;
        known.lower = known.lower.max(grid.lower);
        known.upper = grid.upper;
        known.grids.push(grid);
        if known.upper - known.lower <= settings.gap {
            return Ok(known);
        }
        if found.is_bounded() {
            // A finer grid would not reduce the remaining difference.
            known.stop = Stop::TooManyStates;
            known.within = search.best.filter(|best| best.lower >= known.lower);
            return Ok(known);
        }
    }
    let mut found = refine_bounds(&world, known, settings, &|_| true, goes_on)?;
    if found.stop == Stop::TooManyStates
        && let Some(kinder) = world.without_uncertain_harm()
    {
        let cells = settings.first_cells.max(1) << found.grids.len();
        let upper = relaxed_world::bound_from(&kinder, cells, found.lower, settings, goes_on)?;
        found.upper = found.upper.min(upper);
    }
    if found.upper - found.lower > settings.gap && found.stop == Stop::TooManyStates {
        search.refine(found.upper, settings.most_states, settings, goes_on);
    }
    if let Some(best) = search.best
        && best.lower >= found.lower
    {
        found.lower = best.lower;
        found.within = Some(best);
    }
    Ok(found)
}

/// Returns `true` if the process supports all features of the task and of the world, and happenings
/// take place only at known times.
pub fn has_known_times(task: &Task, model: &WorldModel) -> bool {
    let world = TimedWorld::new(task, model, &Settings::default());
    world.is_ok_and(|world| discrete_events::cells(&world).is_some())
}

/// Returns `true` if the process supports all features of the task and of the world.
pub fn is_supported(task: &Task, model: &WorldModel, settings: &Settings) -> bool {
    TimedWorld::new(task, model, settings).is_ok()
}

/// The lower bounds from sets of actions first get the maximum number of states divided by this,
/// before the whole process is examined.
const FIRST_STATES_DIVISOR: usize = 16;

impl TimedOptimum {
    /// Returns the trivial bounds.
    fn unknown() -> Self {
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
fn refine_bounds(
    world: &TimedWorld,
    known: TimedOptimum,
    settings: &Settings,
    is_promising: &dyn Fn(&[Grid]) -> bool,
    goes_on: &dyn Fn() -> bool,
) -> Result<TimedOptimum, NotTabulated> {
    let mut answer = known;
    let mut cells = settings.first_cells.max(1);
    loop {
        match grid(world, cells, settings, goes_on)? {
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
            answer.stop = Stop::TooManyStates;
            return Ok(answer);
        }
        cells *= 2;
    }
}

/// Widening of the bounds, far above rounding errors.
const ROUNDING_MARGIN: f64 = 1e-9;

/// Returns the length of a cell, in seconds.
fn step(world: &TimedWorld, cells: usize) -> f64 {
    #[allow(clippy::cast_precision_loss, reason = "at most 65,535")]
    let cells = cells as f64;
    world.horizon / cells
}

/// Returns the probabilities of happenings in each of `cells` cells, for a bound; `cells` is below
/// 65,534.
///
/// # Errors
/// When a distribution has no known probabilities.
pub fn cell_probabilities_of(
    world: &TimedWorld,
    cells: usize,
    side: Side,
) -> Result<CellProbabilities, NotTabulated> {
    // In the upper bound, a happening at the horizon belongs to a further cell.
    let all = cells + usize::from(side == Side::Above);
    CellProbabilities::new(world, step(world, cells), all, side)
}

fn grid(
    world: &TimedWorld,
    cells: usize,
    settings: &Settings,
    goes_on: &dyn Fn() -> bool,
) -> Result<Result<Grid, Stop>, NotTabulated> {
    if cells >= usize::from(u16::MAX) {
        return Ok(Err(Stop::TooManyStates));
    }
    let mut left = settings.most_states;
    // The lower bound first, because it detects sooner that there are too many states.
    let lower = match bound(world, (cells, Side::Below), &mut left, goes_on)? {
        Ok(value) => value,
        Err(why) => return Ok(Err(why)),
    };
    let upper = match bound(world, (cells, Side::Above), &mut left, goes_on)? {
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
fn bound(
    world: &TimedWorld,
    (cells, side): (usize, Side),
    left: &mut usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<Result<f64, Stop>, NotTabulated> {
    let chances = cell_probabilities_of(world, cells, side)?;
    let world = &world.for_bound(side);
    Ok(match side {
        Side::Above => {
            let value = graph::value(
                &upper_bound::UpperBound::new(world, &chances),
                left,
                goes_on,
            );
            value.map(|value| (value + ROUNDING_MARGIN).min(1.0))
        }
        Side::Below => {
            let below =
                lower_bound::LowerBound::new(world, &chances, lower_bound::DecisionEpochs::Always);
            let value = graph::value(&below, left, goes_on);
            value.map(|value| (value - ROUNDING_MARGIN).max(0.0))
        }
    })
}
