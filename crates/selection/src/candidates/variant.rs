//! Variants of a problem, whose plans are further plans of the problem.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::problem::{
    Body, Change, Effect, Expression, Fluent, Function, FunctionId, Guard, Metric, Problem,
    SchemaId, TimedChange, TimedInitial, UpdateOperator,
};
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_sim::draw::keyed;
use elbowroom_sim::{ExogenousChange, Purpose, WorldModel};

use super::scarcity::Scarcity;
use crate::rewrite::{add_function_of, set_durations};

/// Number of samples for a quantile.
pub(super) const SAMPLES: u64 = 100;

/// First seed of these samples, far from seeds that users choose.
pub(super) const SEED: u64 = 0x7061_6365_0000_0000;

/// Durations of actions in a variant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Pace {
    /// The planned durations.
    #[default]
    Planned,
    /// The quantiles of durations in the world, in percent. Events of the world have the opposite
    /// quantiles, so they come early.
    Quantile(u64),
    /// The planned durations multiplied by this percentage.
    Slower(u64),
}

/// A variant of the problem.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Variant {
    pace: Pace,
    /// Scarcity of amounts, if any.
    pub(super) scarcity: Option<Scarcity>,
    /// `true` if plans should have actions that rarely fail, rather than a short makespan.
    pub(super) is_reliable: bool,
    /// The actions that plans must not contain.
    pub(super) without: BTreeSet<String>,
}

impl Variant {
    pub(super) fn at(pace: Pace) -> Self {
        Self {
            pace,
            ..Self::default()
        }
    }

    pub(super) fn with(scarcity: Scarcity) -> Self {
        Self {
            scarcity: Some(scarcity),
            ..Self::default()
        }
    }

    pub(super) fn reliable(self) -> Self {
        Self {
            is_reliable: true,
            ..self
        }
    }

    pub(super) fn without(&self, action: &str) -> Self {
        let mut next = self.clone();
        next.without.insert(action.to_owned());
        next
    }

    /// Returns `true` if it is the problem itself.
    pub(super) fn is_problem(&self) -> bool {
        *self == Self::default()
    }

    /// Returns `true` if its plans are plans of the problem without conversion.
    pub(super) fn needs_no_conversion(&self) -> bool {
        self.pace == Pace::Planned && self.scarcity.is_none() && !self.is_reliable
    }

    /// Returns `true` if the same amount is at least as scarce as in `other`.
    pub(super) fn is_scarcer_than(&self, other: &Self) -> bool {
        let (Some(own), Some(others)) = (self.scarcity, other.scarcity) else {
            return false;
        };
        own.of == others.of && own.quantile >= others.quantile
    }

    /// Describes the variant for users; empty for the problem itself.
    pub(super) fn describe(&self, world: Option<&WorldModel>) -> String {
        let mut words = Vec::new();
        match self.pace {
            Pace::Planned => {}
            Pace::Quantile(quantile) => {
                words.push(format!("for durations at their {quantile} % quantiles"));
            }
            Pace::Slower(percent) => {
                words.push(format!("for durations {} % longer", percent - 100));
            }
        }
        if let Some(scarcity) = self.scarcity {
            words.push(scarcity.describe(world));
        }
        if self.is_reliable {
            words.push("of actions that rarely fail".to_owned());
        }
        if !self.without.is_empty() {
            let without: Vec<&str> = self.without.iter().map(String::as_str).collect();
            words.push(format!("without {}", without.join(", ")));
        }
        words.join(", ")
    }

    /// Returns the problem of the variant, starting in the situation; `None` if it does not differ.
    pub(super) fn problem(
        &self,
        task: &Task,
        situation: &Situation,
        world: Option<&WorldModel>,
    ) -> Option<Problem> {
        let mut problem = task.starting_from(situation).problem().clone();
        match (self.pace, world) {
            (Pace::Planned, _) => {}
            (Pace::Quantile(quantile), Some(world)) => {
                let known = RefCell::new(BTreeMap::new());
                slow_down(task, &mut problem, &|name, planned| {
                    quantile_of(&mut known.borrow_mut(), world, name, planned, quantile)
                });
                add_events(&mut problem, world, quantile, &situation.time);
            }
            (Pace::Slower(percent), _) => {
                let factor = Rational::new(i64::try_from(percent).unwrap_or(100), 100);
                slow_down(task, &mut problem, &|_, planned| planned * &factor);
            }
            (Pace::Quantile(_), None) => return None,
        }
        if let Some(scarcity) = self.scarcity {
            scarcity.apply(task, &mut problem, world?);
        }
        if self.is_reliable {
            count_failures(task, &mut problem, world?);
        }
        Some(problem)
    }
}

/// Changes the durations of actions. No duration becomes shorter than planned, because a plan with
/// shorter durations is not a plan of the task.
fn slow_down(task: &Task, problem: &mut Problem, slow: &dyn Fn(&str, &Rational) -> Rational) {
    for schema in (0..problem.schemas.len()).map(SchemaId::from) {
        set_durations(task, schema, problem, &|name, planned| {
            slow(name, planned).max(planned.clone())
        });
    }
}

/// Returns the quantile, in percent, of the time from the command to the end.
fn quantile_of(
    known: &mut BTreeMap<(String, Rational), Vec<Rational>>,
    world: &WorldModel,
    name: &str,
    planned: &Rational,
    quantile: u64,
) -> Rational {
    if world.duration_rule(name).is_none() && world.delay_rule(name).is_none() {
        return planned.clone();
    }
    let key = (name.to_owned(), planned.clone());
    let draws = known.entry(key).or_insert_with(|| {
        let draw = |sample| {
            let rng = |purpose| keyed(SEED + sample, name, 0, purpose);
            let delay = world.delay(name, &mut rng(Purpose::Delay));
            delay + world.duration(name, planned, &mut rng(Purpose::Duration))
        };
        let mut draws: Vec<Rational> = (0..SAMPLES).map(draw).collect();
        draws.sort();
        draws
    });
    draws[quantile_index(quantile)].clone()
}

pub(super) fn quantile_index(quantile: u64) -> usize {
    usize::try_from(quantile.min(100) * (SAMPLES - 1) / 100).unwrap_or(0)
}

/// Adds the events of the world as timed initials, at the opposite quantile of their times. Rare
/// events are omitted.
fn add_events(problem: &mut Problem, world: &WorldModel, quantile: u64, now: &Rational) {
    for (index, event) in world.exogenous.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "below 100")]
        let most = 1.0 - quantile as f64 / 100.0;
        if event.probability <= most {
            continue;
        }
        let (ExogenousChange::Fact(name, _) | ExogenousChange::Value(name, _)) = &event.change;
        let draw = |sample| {
            let mut rng = keyed(SEED + sample, name, index as u64, Purpose::Exogenous);
            event
                .time
                .draw(&Rational::ZERO, &world.resolution, &mut rng)
        };
        let mut draws: Vec<Rational> = (0..SAMPLES).map(draw).collect();
        draws.sort();
        let time = draws[quantile_index(100 - quantile.min(100))].clone();
        let Some(change) = change(problem, &event.change) else {
            continue;
        };
        if time > *now {
            problem.timed.push(TimedInitial { time, change });
        }
    }
}

/// Converts a change of the world to one of the problem; `None` if the problem does not have its
/// fact or fluent.
fn change(problem: &Problem, change: &ExogenousChange) -> Option<TimedChange> {
    let (ExogenousChange::Fact(name, _) | ExogenousChange::Value(name, _)) = change;
    let mut words = name.trim_matches(['(', ')']).split_whitespace();
    let head = words.next()?;
    let objects: Option<Vec<_>> = words.map(|word| problem.object(word)).collect();
    let objects = objects?;
    Some(match change {
        ExogenousChange::Fact(_, true) => TimedChange::Add(problem.predicate(head)?, objects),
        ExogenousChange::Fact(_, false) => TimedChange::Delete(problem.predicate(head)?, objects),
        ExogenousChange::Value(_, value) => {
            TimedChange::Assign(problem.function(head)?, objects, value.clone())
        }
    })
}

/// Replaces the metric by the odds against a plan: the sum of -ln P(no failure) over its actions,
/// plus a small weight for the time, so that the shorter of two equal plans is better.
fn count_failures(task: &Task, problem: &mut Problem, world: &WorldModel) {
    let odds = FunctionId::from(problem.functions.len());
    problem.functions.push(Function {
        // PDDL names have no spaces, so the name is unique.
        name: "odds against".to_owned(),
        parameters: Vec::new(),
    });
    problem
        .initial_values
        .push((odds, Vec::new(), Rational::ZERO));
    let odds = || Fluent {
        function: odds,
        arguments: Vec::new(),
    };
    for schema in (0..problem.schemas.len()).map(SchemaId::from) {
        let value = add_function_of(task, schema, "odds", problem, &|name, _| {
            let fails = world
                .failure_rule(name)
                .map_or(0.0, |rule| rule.probability);
            // An action that always fails gets a large finite cost.
            let against = -(1.0 - fails.min(0.999_999)).ln();
            Some(Rational::new(to_millionths(against), 1_000_000))
        });
        let effect = Effect {
            variables: Vec::new(),
            guard: Guard::default(),
            change: Change::Update {
                operator: UpdateOperator::Increase,
                fluent: odds(),
                value,
            },
        };
        match &mut problem.schemas[schema.index()].body {
            Body::Instantaneous { effects, .. } => effects.push(effect),
            Body::Durative { end_effects, .. } => end_effects.push(effect),
        }
    }
    problem.metric = Some(Metric {
        maximize: false,
        expression: Expression::Fluent(odds()),
    });
}

/// Returns the number in millionths.
pub(super) fn to_millionths(number: f64) -> i64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a probability, or its logarithm"
    )]
    let whole = (number * 1e6).round() as i64;
    whole
}
