//! Lower bounds from restricted policies: only some actions, started or cancelled only after
//! happenings.
//!
//! Such an agent is one of all executors, so its success probability is a lower bound for the best.
//! The agent also starts every action whose start aborts no running action. Its process has far
//! fewer states, because most running actions have the same start time. So its grids can be fine
//! where those of the whole process have too many states. If the bound is close to 1, no upper
//! bound is needed.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_sim::{Distribution, WorldModel};
use serde::{Deserialize, Serialize};

use super::cell_probabilities::CellProbabilities;
use super::graph;
use super::lower_bound::{DecisionEpochs, LowerBound};
use super::process::action_model::Occurs;
use super::process::world::TimedWorld;
use super::settings::{ROUNDING_MARGIN, Settings, Side};

/// A lower bound from a set of actions, each started after a happening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RestrictedPolicy {
    /// The lower bound.
    pub lower: f64,
    /// The length of a cell of its grid, in seconds.
    pub step: f64,
    /// Number of states at the beginnings of cells.
    pub states: usize,
    /// The actions, `(name object …)`.
    pub actions: Vec<String>,
}

/// The lower bounds from sets of actions first get the maximum number of states divided by this,
/// before the whole process is examined.
pub(super) const FIRST_STATES_DIVISOR: usize = 16;

/// Search for bounds from several sets of actions.
pub(super) struct Search {
    sets: Vec<Set>,
    /// The best bound so far.
    pub(super) best: Option<RestrictedPolicy>,
    /// The position of its set, and its grid.
    best_on: Option<(usize, FittedGrid)>,
}

/// A grid whose cells fit known times.
#[derive(Clone, Debug)]
pub(super) struct FittedGrid {
    /// A cell is `time` divided by `parts`.
    time: f64,
    parts: f64,
    /// Number of cells.
    pub(super) cells: usize,
}

impl FittedGrid {
    /// Returns the length of a cell, in seconds.
    pub(super) fn step(&self) -> f64 {
        self.time / self.parts
    }

    /// Returns the exact length of a cell, in seconds.
    pub(super) fn exact_step(&self) -> Option<Rational> {
        let time = Rational::from_f64_as_written(self.time)?;
        Some(time / Rational::from_f64_as_written(self.parts)?)
    }
}

struct Set {
    world: TimedWorld,
    actions: Vec<String>,
    /// Approximate number of cells of the next grid.
    cells: usize,
}

impl Search {
    /// Creates a search within each of the [plans](Settings::plans), and within all of them
    /// together. Runs end at `horizon`, in seconds, unless the settings have another one.
    pub(super) fn new(
        task: &Task,
        model: &WorldModel,
        settings: &Settings,
        horizon: Option<f64>,
    ) -> Self {
        let horizon = settings
            .horizon
            .clone()
            .or_else(|| Rational::from_f64_as_written(horizon?));
        let mut all: Vec<Vec<String>> = Vec::new();
        let mut add = |mut actions: Vec<String>| {
            actions.sort_unstable();
            actions.dedup();
            if !all.contains(&actions) {
                all.push(actions);
            }
        };
        let allowed = |name: &String| {
            let only = settings.only.as_ref();
            only.is_none_or(|only| only.iter().any(|it| it.eq_ignore_ascii_case(name)))
        };
        for plan in &settings.plans {
            add(plan.iter().filter(|name| allowed(name)).cloned().collect());
        }
        let together = settings.plans.iter().flatten();
        add(together.filter(|name| allowed(name)).cloned().collect());
        let sets = all.into_iter().filter(|actions| !actions.is_empty());
        let sets = sets.filter_map(|actions| {
            let within = Settings {
                only: Some(actions.clone()),
                horizon: horizon.clone(),
                ..settings.clone()
            };
            let world = TimedWorld::new(task, model, &within).ok()?;
            Some(Set {
                world,
                actions,
                cells: settings.first_cells.max(1),
            })
        });
        Self {
            sets: sets.collect(),
            best: None,
            best_on: None,
        }
    }

    /// Returns the best bound, with the world of its actions and its grid.
    pub(super) fn into_best(mut self) -> Option<(TimedWorld, FittedGrid, RestrictedPolicy)> {
        let (place, fit) = self.best_on?;
        Some((self.sets.swap_remove(place).world, fit, self.best?))
    }

    /// Returns the best lower bound; 0 if there is none.
    pub(super) fn lower(&self) -> f64 {
        self.best.as_ref().map_or(0.0, |best| best.lower)
    }

    /// Refines the grids of all sets alternately, until the bound is close to `upper`, or the grids
    /// have more than `most_states` states.
    pub(super) fn refine(
        &mut self,
        upper: f64,
        most_states: usize,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) {
        let mut going: Vec<usize> = (0..self.sets.len()).collect();
        while !going.is_empty() {
            let mut left = Vec::new();
            for place in going {
                if upper - self.lower() <= settings.gap {
                    return;
                }
                if let Some((found, fit)) = self.sets[place].next(most_states, may_continue) {
                    left.push(place);
                    if found.lower > self.lower() {
                        self.best = Some(found);
                        self.best_on = Some((place, fit));
                    }
                }
            }
            going = left;
        }
    }
}

impl Set {
    /// Computes the bound on the next grid; `None` if it has too many states, or `may_continue` returns
    /// `false`.
    fn next(
        &mut self,
        most_states: usize,
        may_continue: &dyn Fn() -> bool,
    ) -> Option<(RestrictedPolicy, FittedGrid)> {
        let fit = fitting(&self.world, self.cells, Side::Below)?;
        let step = fit.step();
        let chances = CellProbabilities::new(&self.world, step, fit.cells, Side::Below).ok()?;
        let bound = LowerBound::new(&self.world, &chances, DecisionEpochs::AfterHappenings);
        let mut left = most_states;
        let value = graph::value(&bound, &mut left, may_continue).ok()?;
        self.cells *= 2;
        let lower = (value - ROUNDING_MARGIN).max(0.0);
        let within = RestrictedPolicy {
            lower,
            step,
            states: most_states - left,
            actions: self.actions.clone(),
        };
        Some((within, fit))
    }
}

/// Returns the grid with `cells` to twice as many cells that fits known times best.
///
/// In the lower bound, each duration or deadline that is not a whole number of cells causes a loss,
/// because the agent acts only at boundaries; so does a grid that ends before the horizon. In the
/// upper bound, durations are rounded down to whole numbers of cells.
pub(super) fn fitting(world: &TimedWorld, cells: usize, side: Side) -> Option<FittedGrid> {
    // Times after the horizon are irrelevant.
    let is_within = |time: &f64| *time <= world.horizon;
    let lasting = world.acts.iter().filter_map(|act| constant(world, act));
    let lasting: Vec<f64> = lasting.filter(is_within).collect();
    let events = world.events.iter().filter_map(|event| match &event.occurs {
        Occurs::Once { time, .. } => match time.distribution {
            Distribution::Constant(time) => Some(time),
            _ => None,
        },
        Occurs::Rate(_) => None,
    });
    let times: Vec<f64> = events.filter(is_within).collect();
    #[allow(clippy::cast_precision_loss, reason = "at most 65,535 cells")]
    let wanted = cells as f64;
    let coarsest = world.horizon / wanted;
    let loss = |step: f64| {
        let over = |time: &f64| ((time / step - 1e-9).ceil() * step - time).max(0.0);
        let under = |time: &f64| (time - (time / step + 1e-9).floor() * step).max(0.0);
        match side {
            Side::Below => {
                let lost: f64 = lasting.iter().map(over).sum();
                lost + times.iter().chain([&world.horizon]).map(under).sum::<f64>()
            }
            Side::Above => lasting.iter().map(under).sum(),
        }
    };
    let mut best = (world.horizon, wanted);
    for time in lasting.iter().chain(&times).chain([&world.horizon]) {
        let mut parts = (time / coarsest).ceil().max(1.0);
        while time / parts >= coarsest / 2.0 {
            let step = time / parts;
            if step <= coarsest && loss(step) < loss(best.0 / best.1) - 1e-9 {
                best = (*time, parts);
            }
            parts += 1.0;
        }
    }
    let (time, parts) = best;
    let count = (world.horizon / (time / parts) + 1e-9).floor();
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "it is a small positive number"
    )]
    let cells = (count < f64::from(u16::MAX)).then_some(count as usize)?;
    Some(FittedGrid { time, parts, cells })
}

/// Returns the duration of an action, if it is constant.
pub(super) fn constant(
    world: &TimedWorld,
    act: &super::process::action_model::ActionModel,
) -> Option<f64> {
    act.rest.as_ref()?;
    let planned = act.planned.to_f64();
    let time = match world.model.duration_rule(&act.name) {
        None => planned,
        Some(rule) => match rule.distribution {
            Distribution::Constant(time) if rule.is_relative => time * planned,
            Distribution::Constant(time) => time,
            _ => return None,
        },
    };
    (time > 0.0).then_some(time)
}
