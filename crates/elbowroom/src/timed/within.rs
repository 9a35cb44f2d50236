//! Bounds from below by agents that allow themselves less than they may.
//!
//! Whoever does nothing but certain actions, and begins or cancels something only when something has
//! just happened, is one of all executors, so the best of all is at least as good. It also leaves
//! nothing undone that breaks nothing off which is under way. The process of
//! such an agent has far fewer states: of what is under way at the same time, most has begun at the
//! same time. So its grids are fine where those of the whole process have too many states. Where the
//! best nearly always reaches the goal, that is all that has to be known: 1 is a bound from above.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_sim::{Distribution, WorldModel};
use serde::{Deserialize, Serialize};

use super::act::Occurs;
use super::below::{Below, Manner};
use super::chances::Chances;
use super::{SLACK, Settings, Side, TimedWorld, graph};

/// A bound from below, by whoever does nothing but certain actions, each when something has happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Within {
    /// It succeeds at least with this probability.
    pub lower: f64,
    /// The length of a cell of the grid that says so, in seconds.
    pub step: f64,
    /// How many states there were at the beginnings of cells.
    pub states: usize,
    /// The actions, `(name object …)`.
    pub actions: Vec<String>,
}

/// Looks for bounds within several sets of actions.
pub(super) struct Search {
    sets: Vec<Set>,
    /// The best so far.
    pub(super) best: Option<Within>,
    /// The number of its set, and its grid.
    best_on: Option<(usize, Fit)>,
}

/// A grid whose cells fit the times that are known.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// A time, in so many cells.
    time: f64,
    parts: f64,
    /// How many cells there are.
    pub(super) cells: usize,
}

impl Fit {
    /// The length of a cell, in seconds.
    pub(super) fn step(&self) -> f64 {
        self.time / self.parts
    }

    /// The same, exactly.
    pub(super) fn exact_step(&self) -> Option<Rational> {
        let time = Rational::from_f64_as_written(self.time)?;
        Some(time / Rational::from_f64_as_written(self.parts)?)
    }
}

struct Set {
    world: TimedWorld,
    actions: Vec<String>,
    /// How many cells the next grid is to have, about.
    cells: usize,
}

impl Search {
    /// Within each of the [plans](Settings::plans), and within all of them together. Runs end at
    /// `horizon`, in seconds, if nothing else is known to end them.
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

    /// The best, with the world of its actions and its grid.
    pub(super) fn into_best(mut self) -> Option<(TimedWorld, Fit, Within)> {
        let (place, fit) = self.best_on?;
        Some((self.sets.swap_remove(place).world, fit, self.best?))
    }

    /// The best value found, 0 if there is none.
    pub(super) fn lower(&self) -> f64 {
        self.best.as_ref().map_or(0.0, |best| best.lower)
    }

    /// Finer and finer grids, one of each set after the other, until the bound is close to `upper`, or
    /// they have more states than `most_states`.
    pub(super) fn refine(
        &mut self,
        upper: f64,
        most_states: usize,
        settings: &Settings,
        goes_on: &dyn Fn() -> bool,
    ) {
        let mut going: Vec<usize> = (0..self.sets.len()).collect();
        while !going.is_empty() {
            let mut left = Vec::new();
            for place in going {
                if upper - self.lower() <= settings.gap {
                    return;
                }
                if let Some((found, fit)) = self.sets[place].next(most_states, goes_on) {
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
    /// The next grid; `None` if it has too many states, or nobody wants it.
    fn next(&mut self, most_states: usize, goes_on: &dyn Fn() -> bool) -> Option<(Within, Fit)> {
        let fit = fitting(&self.world, self.cells, Side::Below)?;
        let step = fit.step();
        let chances = Chances::new(&self.world, step, fit.cells, Side::Below).ok()?;
        let bound = Below::new(&self.world, &chances, Manner::WhenSomethingHappens);
        let mut left = most_states;
        let value = graph::value(&bound, &mut left, goes_on).ok()?;
        self.cells *= 2;
        let lower = (value - SLACK).max(0.0);
        let within = Within {
            lower,
            step,
            states: most_states - left,
            actions: self.actions.clone(),
        };
        Some((within, fit))
    }
}

/// The grid of so many cells up to twice as many that fits the times that are known best.
///
/// Seen from below, whoever acts at the boundaries of cells loses what is missing to a whole number of them for each
/// such time, a duration or a deadline. It may end before the horizon: that is a loss, too. Seen from above, what
/// durations are more than a whole number of cells is given away.
pub(super) fn fitting(world: &TimedWorld, cells: usize, side: Side) -> Option<Fit> {
    // Later times do not matter, however many cells fit into them.
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
    Some(Fit { time, parts, cells })
}

/// How long an action takes, if that is known.
pub(super) fn constant(world: &TimedWorld, act: &super::act::Act) -> Option<f64> {
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
