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
//! (`process::numbers`). A comparison is an additional fact. In the upper bound it holds if some of the
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
mod refinement;
mod relaxed_world;
mod restricted_policy;
mod settings;
mod state;
mod upper_bound;

use elbowroom_model::Task;
use elbowroom_sim::WorldModel;

pub use action_subsets::supported;
pub use cell_probabilities::{CellProbabilities, EndProbabilities, cell_probabilities_of};
pub use policy::Policy;
pub use refinement::TimedOptimum;
pub use restricted_policy::RestrictedPolicy;
pub use settings::{Grid, NotTabulated, Settings, Side, Stop};

use process::world::TimedWorld;
use refinement::refine_bounds;
use restricted_policy::FIRST_STATES_DIVISOR;

/// Bounds the success probability of the best executor without foresight.
///
/// `may_continue` is called regularly; if it returns `false`, the answer contains the bounds found so
/// far.
///
/// # Errors
/// When the task or the world has a feature that the process does not support.
pub fn optimum(
    task: &Task,
    model: &WorldModel,
    settings: &Settings,
    may_continue: &dyn Fn() -> bool,
) -> Result<TimedOptimum, NotTabulated> {
    let world = TimedWorld::new(task, model, settings);
    let horizon = world.as_ref().ok().map(|world| world.horizon);
    let mut search = restricted_policy::Search::new(task, model, settings, horizon);
    search.refine(
        1.0,
        settings.most_states / FIRST_STATES_DIVISOR,
        settings,
        may_continue,
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
    if let Some(found) = discrete_events::bounds(
        &world,
        settings,
        discrete_events::Effort::WHOLE,
        may_continue,
    )? {
        let grid = found.grid;
        known.lower = known.lower.max(grid.lower);
        known.upper = grid.upper;
        known.grids.push(grid);
        if known.upper - known.lower <= settings.gap {
            return Ok(known);
        }
        if found.is_bounded() {
            // A finer grid would not reduce the remaining difference.
            known.stop = Stop::FinestGrid;
            known.within = search.best.filter(|best| best.lower >= known.lower);
            return Ok(known);
        }
    }
    let mut found = refine_bounds(&world, known, settings, &|_| true, may_continue)?;
    let is_limited = matches!(found.stop, Stop::TooManyStates | Stop::FinestGrid);
    if is_limited && let Some(kinder) = world.without_uncertain_harm() {
        let cells = settings.first_cells.max(1) << found.grids.len();
        let upper = relaxed_world::bound_from(&kinder, cells, found.lower, settings, may_continue)?;
        found.upper = found.upper.min(upper);
    }
    if found.upper - found.lower > settings.gap && is_limited {
        search.refine(found.upper, settings.most_states, settings, may_continue);
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

/// Checks whether the process supports all features of the task and of the world.
///
/// # Errors
/// When it does not support one of them.
pub fn check_support(
    task: &Task,
    model: &WorldModel,
    settings: &Settings,
) -> Result<(), NotTabulated> {
    TimedWorld::new(task, model, settings).map(|_| ())
}
