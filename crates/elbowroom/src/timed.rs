//! The yardstick on a clock: how likely the best of all executors is to reach the goal in a world
//! of which everything is known but what will happen.
//!
//! The world is a semi-Markov decision process. Its state is the truth of all facts, the actions
//! under way with the time since each began, what has happened by itself, and the clock. The agent
//! sees the state, and may at any moment start an action whose condition holds, cancel one that is
//! under way, or wait. What it does not see is the future: how long an action will take, whether it
//! fails and what it then leaves behind, when something happens by itself, are drawn from the world
//! file's distributions, given what has been seen so far. It succeeds as soon as the goal holds. Any action of the problem is
//! available at any time, and deciding takes no time, so no executor, however it plans, does
//! better.
//!
//! **Numbers.** Of a number that actions change the state knows between which values it lies
//! (`numbers`). A comparison counts as one more fact: from above it holds if some of the values meet it,
//! from below if all do. What is drawn is cut where that decides a comparison.
//!
//! What the process leaves out: interfering happenings may be as close as one likes (ε is nothing),
//! and happenings that coincide take place one after the other. Whether an action has broken down and
//! can no longer be cancelled is not seen either: the bound from below never cancels one of which that
//! may be so, and the goal counts when it is over; the one from above always can. A start that fails
//! costs no time and can be tried again at once.
//!
//! **Bounds.** The best value is bounded from both sides on a grid of time: cells of one length.
//!
//! - *Above*, `Side::Above`: the agent is told at the beginning of a cell what will end or happen
//!   in it, and chooses the order within the cell. What began in cell c and takes n whole cells and
//!   something ends in cell c + n or in the next one; the agent chooses that, too. An agent in the
//!   real world that knows less can be imitated step by step, with the remainders drawn at random,
//!   so this is at least as good as the best.
//! - *Below*, `Side::Below`: the agent decides only at the boundaries of cells, and what happens
//!   between them happens in the order that is worst for it. That is a way to act in the real
//!   world, so the best is at least as good.
//!
//! Neither takes for granted that being earlier never hurts. Where it does not (no condition asks
//! for something to be false), fewer cases are looked at.
//!
//! Where everything happens at known times, if it happens, there is no grid: states are only where something
//! happens or gets ready to (`moments`).
//!
//! Where plans are known, the value is bounded from below by whoever keeps to the actions of one of them
//! and acts only when something has happened, too (`within`): that takes far fewer states.
//!
//! The cells are halved until the bounds are close enough, or there are too many states. Where more
//! facts are never worse, the bound from above is then taken on finer grids of a *kinder* world
//! (`kinder`): one in which what may happen at one time or another, and does nothing but harm,
//! never happens. It has fewer states, and whoever succeeds in the real world does so in it.
//! Probabilities are floating-point numbers; the bounds are widened by 1e-9, far more than rounding
//! adds up to.

mod above;
mod act;
mod available;
mod below;
mod chances;
mod compile;
mod failures;
mod graph;
mod kinder;
mod moments;
mod numbers;
mod policy;
mod projection;
mod sets;
mod state;
mod within;
mod world;

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

pub(crate) use act::{Act, Event, Needs};
pub(crate) use chances::{Chances, Ends};
pub use policy::Policy;
pub use sets::supported;
pub use within::Within;
pub(crate) use world::{Facts, TimedWorld};

/// How far to go.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The bounds are close enough when they are so far apart.
    pub gap: f64,
    /// No grid is finished on which there are more states than this, all cells together.
    pub most_states: usize,
    /// How many cells the first grid has.
    pub first_cells: usize,
    /// When a run ends at the latest; `None`: when nothing more happens by itself.
    pub horizon: Option<Rational>,
    /// The only actions that are available, `(name object …)`; `None`: all that there are.
    pub only: Option<Vec<String>>,
    /// Sets of actions, such as those of plans: whoever does nothing but these is no better than the
    /// best, but is easier to reckon with.
    pub plans: Vec<Vec<String>>,
    /// Further sets of actions: those of plans for when one of the [plans](Self::plans) has failed, with what they
    /// need of it ([`supported`]). They are only looked at where everything happens at known times, after the plans.
    pub fallbacks: Vec<Vec<String>>,
}

impl Default for Settings {
    /// A percentage point, and some seconds.
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

/// Why no finer grid was tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The bounds are close enough.
    Close,
    /// The next grid has too many states.
    TooManyStates,
    /// Whoever asked wants no more.
    Interrupted,
}

/// What the best of all executors can reach.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimedOptimum {
    /// It succeeds at least with this probability.
    pub lower: f64,
    /// And at most with this one.
    pub upper: f64,
    /// Each grid that was finished, coarse ones first.
    pub grids: Vec<Grid>,
    /// Why no finer grid was tried.
    pub stop: Stop,
    /// By whom the bound from below is reached, if not by whoever acts at the boundaries of the finest
    /// grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<Within>,
}

/// What one grid says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The length of a cell, in seconds.
    pub step: f64,
    /// The bound from below.
    pub lower: f64,
    /// The bound from above.
    pub upper: f64,
    /// How many states there were at the beginnings of cells, for both bounds.
    pub states: usize,
}

/// From where the best value is approached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// A bound from below.
    Below,
    /// A bound from above.
    Above,
}

/// The world is not one for which there is a timed optimum here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; the optimum without foresight is only calculated without that")]
pub struct NotTabulated {
    /// What there is.
    pub what: String,
}

impl NotTabulated {
    fn new(what: impl Into<String>) -> Self {
        Self { what: what.into() }
    }
}

/// Bounds for what the best executor without foresight reaches in a world.
///
/// `goes_on` is asked now and then; what has been found until it says no is the answer.
///
/// # Errors
/// When there is something in the task or in the world that the process does not know.
pub fn optimum(
    task: &Task,
    model: &WorldModel,
    settings: &Settings,
    goes_on: &dyn Fn() -> bool,
) -> Result<TimedOptimum, NotTabulated> {
    let world = TimedWorld::new(task, model, settings);
    let horizon = world.as_ref().ok().map(|world| world.horizon);
    let mut search = within::Search::new(task, model, settings, horizon);
    search.refine(1.0, settings.most_states / QUICK_SHARE, settings, goes_on);
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
    if let Some(found) = moments::bounds(&world, settings, moments::Effort::WHOLE, goes_on)? {
        let grid = found.grid;
        known.lower = known.lower.max(grid.lower);
        known.upper = grid.upper;
        known.grids.push(grid);
        if known.upper - known.lower <= settings.gap {
            return Ok(known);
        }
        if found.is_bounded() {
            // What is left between the bounds is not due to a grid.
            known.stop = Stop::TooManyStates;
            known.within = search.best.filter(|best| best.lower >= known.lower);
            return Ok(known);
        }
    }
    let mut found = refined(&world, known, settings, &|_| true, goes_on)?;
    if found.stop == Stop::TooManyStates
        && let Some(kinder) = world.without_chances_of_harm()
    {
        let cells = settings.first_cells.max(1) << found.grids.len();
        let upper = kinder::bound_from(&kinder, cells, found.lower, settings, goes_on)?;
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

/// Whether the process knows all that there is in a task and in a world, and everything happens at known times, if it
/// happens.
pub fn happens_at_known_times(task: &Task, model: &WorldModel) -> bool {
    let world = TimedWorld::new(task, model, &Settings::default());
    world.is_ok_and(|world| moments::cells(&world).is_some())
}

/// Whether the process knows all that there is in a task and in a world.
pub fn knows(task: &Task, model: &WorldModel, settings: &Settings) -> bool {
    TimedWorld::new(task, model, settings).is_ok()
}

/// Of the states that there may be, those that act within certain actions may have one in so many before
/// the whole process is looked at.
const QUICK_SHARE: usize = 16;

impl TimedOptimum {
    /// What is known without any grid.
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

/// Finer and finer grids of a world, of which that is known. `is_promising` is asked after each whether to go on.
fn refined(
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

/// Rounding errors stay far below this.
const SLACK: f64 = 1e-9;

/// The length of a cell, in seconds.
fn step(world: &TimedWorld, cells: usize) -> f64 {
    #[allow(clippy::cast_precision_loss, reason = "at most 65,535")]
    let cells = cells as f64;
    world.horizon / cells
}

/// In which of so many cells what happens does, as a bound sees it; `cells` is below 65,534.
pub(crate) fn chances(
    world: &TimedWorld,
    cells: usize,
    side: Side,
) -> Result<Chances, NotTabulated> {
    // What happens at the horizon itself begins a cell, seen from above.
    let all = cells + usize::from(side == Side::Above);
    Chances::new(world, step(world, cells), all, side)
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
    // That from below first: where there are too many states, it is sooner known.
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

/// A bound on one grid. `left` is how many states there may still be.
fn bound(
    world: &TimedWorld,
    (cells, side): (usize, Side),
    left: &mut usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<Result<f64, Stop>, NotTabulated> {
    let chances = chances(world, cells, side)?;
    let world = &world.seen_from(side);
    Ok(match side {
        Side::Above => {
            let value = graph::value(&above::Above::new(world, &chances), left, goes_on);
            value.map(|value| (value + SLACK).min(1.0))
        }
        Side::Below => {
            let below = below::Below::new(world, &chances, below::Manner::Always);
            let value = graph::value(&below, left, goes_on);
            value.map(|value| (value - SLACK).max(0.0))
        }
    })
}
