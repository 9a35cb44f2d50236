//! Problems like a given one, whose plans are other plans of it.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{Action, Expression as GroundExpression};
use elbowroom_model::problem::{
    Body, Change, Comparison, Effect, Expression, Fluent, Function, FunctionId, Guard, Metric,
    Problem, SchemaId, TimedChange, TimedInitial, UpdateOperator,
};
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_sim::draw::keyed;
use elbowroom_sim::{ExogenousChange, Purpose, WorldModel};

use super::super::rewrite::{add_function_of, set_durations};
use super::scarcity::Scarcity;

/// How many samples a quantile is taken from.
pub(super) const SAMPLES: u64 = 100;

/// Where the seeds of these samples begin: far from those that people choose.
pub(super) const SEED: u64 = 0x7061_6365_0000_0000;

/// How long actions take in a variant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Pace {
    /// As long as planned.
    #[default]
    Planned,
    /// As long as in that many of 100 cases at most, in the world; events of the world come as
    /// early as in all others.
    Quantile(u64),
    /// So many hundredths of what is planned.
    Slower(u64),
}

/// A problem like the given one.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Variant {
    pace: Pace,
    /// Whether there is less of things than planned.
    pub(super) scarcity: Option<Scarcity>,
    /// Whether plans are to have actions that seldom fail, rather than to be short.
    pub(super) is_reliable: bool,
    /// The actions that plans must do without.
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

    /// Whether it is the problem itself.
    pub(super) fn is_problem(&self) -> bool {
        *self == Self::default()
    }

    /// Whether its plans are plans of the problem as they stand.
    pub(super) fn is_as_written(&self) -> bool {
        self.pace == Pace::Planned && self.scarcity.is_none() && !self.is_reliable
    }

    /// Whether the same is scarcer in it, or as scarce.
    pub(super) fn is_scarcer_than(&self, other: &Self) -> bool {
        let (Some(own), Some(others)) = (self.scarcity, other.scarcity) else {
            return false;
        };
        own.of == others.of && own.quantile >= others.quantile
    }

    /// What it is, for people; empty for the problem itself.
    pub(super) fn words(&self, world: Option<&WorldModel>) -> String {
        let mut words = Vec::new();
        match self.pace {
            Pace::Planned => {}
            Pace::Quantile(quantile) => {
                words.push(format!(
                    "for durations that {quantile} of 100 do not exceed"
                ));
            }
            Pace::Slower(percent) => {
                words.push(format!("for durations {} % longer", percent - 100));
            }
        }
        if let Some(scarcity) = self.scarcity {
            words.push(scarcity.words(world));
        }
        if self.is_reliable {
            words.push("of actions that seldom fail".to_owned());
        }
        if !self.without.is_empty() {
            let without: Vec<&str> = self.without.iter().map(String::as_str).collect();
            words.push(format!("without {}", without.join(", ")));
        }
        words.join(", ")
    }

    /// The problem, beginning where the situation is; `None` where it is no other one.
    pub(super) fn problem(
        &self,
        task: &Task,
        situation: &Situation,
        world: Option<&WorldModel>,
    ) -> Option<Problem> {
        let mut problem = task.beginning_at(situation).problem().clone();
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

/// Gives actions another duration. A plan in which something is over too soon is none of the task,
/// so none is shorter than planned.
fn slow_down(task: &Task, problem: &mut Problem, slow: &dyn Fn(&str, &Rational) -> Rational) {
    for schema in (0..problem.schemas.len()).map(SchemaId::from) {
        set_durations(task, schema, problem, &|name, planned| {
            slow(name, planned).max(planned.clone())
        });
    }
}

/// From the command to the end, in that many of 100 cases at most.
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
    draws[place_of(quantile)].clone()
}

pub(super) fn place_of(quantile: u64) -> usize {
    usize::try_from(quantile.min(100) * (SAMPLES - 1) / 100).unwrap_or(0)
}

/// What happens by itself, as timed initials: as early as all but that many of 100 times. What
/// happens seldom is left out.
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
        let time = draws[place_of(100 - quantile.min(100))].clone();
        let Some(change) = change(problem, &event.change) else {
            continue;
        };
        if time > *now {
            problem.timed.push(TimedInitial { time, change });
        }
    }
}

/// A change of the world as one of the problem; `None` where the problem does not have it.
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

/// Makes the metric the odds against a plan: the sum, over its actions, of -ln P(it does not fail),
/// and a little for the time, so that of plans alike the shorter one is better.
fn count_failures(task: &Task, problem: &mut Problem, world: &WorldModel) {
    let odds = FunctionId::from(problem.functions.len());
    problem.functions.push(Function {
        // No PDDL name has a space, so none is the same.
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
            let fails = world.failing(name).map_or(0.0, |rule| rule.probability);
            // What always fails is worse than anything.
            let against = -(1.0 - fails.min(0.999_999)).ln();
            Some(Rational::new(written(against), 1_000_000))
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

/// Millionths.
pub(super) fn written(number: f64) -> i64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a probability, or its logarithm"
    )]
    let whole = (number * 1e6).round() as i64;
    whole
}

/// The duration that the domain fixes to a number.
pub(super) fn duration_fixed_by_domain(action: &Action) -> Option<Rational> {
    let [only] = action.durative()?.duration.as_slice() else {
        return None;
    };
    match (&only.comparison, &only.bound) {
        (Comparison::Equal, GroundExpression::Constant(value)) => Some(value.clone()),
        _ => None,
    }
}
