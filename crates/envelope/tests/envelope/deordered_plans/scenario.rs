//! Random problems with a valid plan, and as many conditions as hold in it.

use std::sync::Arc;

use elbowroom_model::problem::{
    Atom, Body, Change, Comparison, Condition, ContinuousEffect, DurationConstraint, Effect,
    Expression, Fluent, Function, FunctionId, Guard, Predicate, PredicateId, Problem, Schema,
    SchemaId, TimedChange, TimedInitial, Type, UpdateOperator,
};
use elbowroom_model::validate::Settings;
use elbowroom_model::{Step, Task, TimeTriggeredPlan, validate};
use elbowroom_num::Rational;
use rand::Rng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

const FACTS: u32 = 4;
const FLUENTS: u32 = 3;

/// Problem of actions without parameters, with the start times and durations of its plan.
#[derive(Clone)]
pub(super) struct Scenario {
    problem: Problem,
    times: Vec<(Rational, Option<Rational>)>,
}

impl Scenario {
    pub(super) fn task(&self) -> Task {
        Task::new(self.problem.clone())
    }

    pub(super) fn plan(&self, task: &Task) -> TimeTriggeredPlan {
        let steps = self
            .times
            .iter()
            .enumerate()
            .map(|(index, (start, duration))| Step {
                start: start.clone(),
                action: Arc::new(
                    task.instantiate(SchemaId::from(index), &[])
                        .expect("an action without arguments"),
                ),
                duration: duration.clone(),
            });
        TimeTriggeredPlan {
            steps: steps.collect(),
        }
    }

    fn is_valid(&self) -> bool {
        let task = self.task();
        let plan = self.plan(&task);
        validate(&task, &plan, &Settings::default()).is_valid()
    }
}

fn integer(value: i64) -> Expression {
    Expression::Constant(Rational::from(value))
}

fn fact(rng: &mut ChaCha8Rng) -> Atom {
    Atom {
        predicate: PredicateId(rng.random_range(0..FACTS)),
        arguments: Vec::new(),
    }
}

fn fluent(rng: &mut ChaCha8Rng) -> Fluent {
    Fluent {
        function: FunctionId(rng.random_range(0..FLUENTS)),
        arguments: Vec::new(),
    }
}

/// Returns a random time on a grid, so that happenings often coincide.
pub(super) fn time(rng: &mut ChaCha8Rng, most: i64) -> Rational {
    Rational::new(rng.random_range(1..=2 * most), 2)
}

/// Returns the guard of an effect, usually trivial. Only end effects can read the state at the
/// start.
fn guard(rng: &mut ChaCha8Rng, is_end: bool) -> Guard {
    let mut part = |may_be: bool| {
        if may_be && rng.random_bool(0.08) {
            condition(rng)
        } else {
            Condition::TRUE
        }
    };
    Guard {
        at_start: part(is_end),
        over_all: part(is_end),
        now: part(true),
    }
}

fn effects(rng: &mut ChaCha8Rng, is_timeless: bool, is_end: bool) -> Vec<Effect> {
    let count = rng.random_range(0..3);
    let change = |rng: &mut ChaCha8Rng| match rng.random_range(0..6) {
        0 | 1 => Change::Add(fact(rng)),
        2 | 3 => Change::Delete(fact(rng)),
        kind => Change::Update {
            operator: if kind == 4 {
                UpdateOperator::Increase
            } else {
                *[UpdateOperator::Assign, UpdateOperator::Decrease]
                    .choose(rng)
                    .expect("something to choose from")
            },
            fluent: fluent(rng),
            value: match rng.random_range(0..6) {
                0 => Expression::Fluent(fluent(rng)),
                1 if !is_timeless => Expression::Duration,
                _ => integer(rng.random_range(-3..6)),
            },
        },
    };
    (0..count)
        .map(|_| Effect {
            variables: Vec::new(),
            guard: guard(rng, is_end),
            change: change(rng),
        })
        .collect()
}

fn duration_constraints(rng: &mut ChaCha8Rng, duration: &Rational) -> Vec<DurationConstraint> {
    let limit = |comparison, bound| DurationConstraint {
        comparison,
        bound,
        at_end: false,
    };
    let constant = |value: Rational| Expression::Constant(value);
    match rng.random_range(0..4) {
        0 => vec![limit(Comparison::Equal, constant(duration.clone()))],
        1 => vec![
            limit(
                Comparison::AtLeast,
                constant(duration - Rational::new(1, 4)),
            ),
            limit(Comparison::AtMost, constant(duration + Rational::from(3))),
        ],
        2 => vec![DurationConstraint {
            comparison: *[Comparison::AtMost, Comparison::AtLeast]
                .choose(rng)
                .expect("something to choose from"),
            bound: Expression::Fluent(fluent(rng)),
            at_end: rng.random(),
        }],
        _ => Vec::new(),
    }
}

/// Generates random effects and times. With `is_timeless`, no value depends on times.
fn effects_only(rng: &mut ChaCha8Rng, is_timeless: bool) -> Scenario {
    let mut schemas = Vec::new();
    let mut times = Vec::new();
    for index in 0..rng.random_range(1..7) {
        let is_durative = rng.random_bool(0.8);
        let duration = is_durative.then(|| time(rng, 4) - Rational::new(1, 2));
        let body = match &duration {
            None => Body::Instantaneous {
                condition: Condition::TRUE,
                effects: effects(rng, true, false),
            },
            Some(duration) => Body::Durative {
                duration: duration_constraints(rng, duration),
                at_start: Condition::TRUE,
                over_all: Condition::TRUE,
                at_end: Condition::TRUE,
                start_effects: effects(rng, is_timeless, false),
                end_effects: effects(rng, is_timeless, true),
                continuous: if is_timeless || rng.random_bool(0.6) {
                    Vec::new()
                } else {
                    vec![ContinuousEffect {
                        variables: Vec::new(),
                        guard: Guard::default(),
                        fluent: fluent(rng),
                        rate: integer(rng.random_range(-2..4)),
                    }]
                },
            },
        };
        schemas.push(Schema {
            name: format!("a{index}"),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body,
        });
        times.push((time(rng, 10), duration));
    }
    // All times differ, because initials of one time must not contradict each other.
    let moments: std::collections::BTreeSet<_> =
        (0..rng.random_range(0..4)).map(|_| time(rng, 12)).collect();
    let initials = moments.into_iter().map(|time| TimedInitial {
        time,
        change: match rng.random_range(0..3) {
            0 => TimedChange::Add(fact(rng).predicate, Vec::new()),
            1 => TimedChange::Delete(fact(rng).predicate, Vec::new()),
            _ => TimedChange::Assign(fluent(rng).function, Vec::new(), Rational::from(4)),
        },
    });
    let problem = Problem {
        types: vec![Type {
            name: "object".to_owned(),
            parents: Vec::new(),
        }],
        predicates: (0..FACTS)
            .map(|index| Predicate {
                name: format!("p{index}"),
                parameters: Vec::new(),
                is_derived: false,
            })
            .collect(),
        functions: (0..FLUENTS)
            .map(|index| Function {
                name: format!("f{index}"),
                parameters: Vec::new(),
            })
            .collect(),
        timed: initials.collect(),
        schemas,
        initial_facts: vec![(PredicateId(0), Vec::new()), (PredicateId(1), Vec::new())],
        initial_values: (0..FLUENTS)
            .map(|index| (FunctionId(index), Vec::new(), Rational::from(5)))
            .collect(),
        ..Problem::default()
    };
    Scenario { problem, times }
}

fn comparison(rng: &mut ChaCha8Rng) -> Condition {
    let one = Expression::Fluent(fluent(rng));
    let left = match rng.random_range(0..4) {
        0 => Expression::Add(vec![one, Expression::Fluent(fluent(rng))]),
        _ => one,
    };
    Condition::Compare(
        *[Comparison::AtMost, Comparison::AtLeast, Comparison::Equal]
            .choose(rng)
            .expect("something to choose from"),
        left,
        integer(rng.random_range(-2..12)),
    )
}

fn condition(rng: &mut ChaCha8Rng) -> Condition {
    let atom = Condition::Atom(fact(rng));
    match rng.random_range(0..8) {
        0 | 1 => atom,
        2 | 3 => Condition::Not(Box::new(atom)),
        4 => Condition::Or(vec![atom, Condition::Atom(fact(rng))]),
        5 => Condition::Or(vec![Condition::Not(Box::new(atom)), comparison(rng)]),
        _ => comparison(rng),
    }
}

/// Returns the scenario with one more condition in a random place.
fn with_condition(scenario: &Scenario, rng: &mut ChaCha8Rng) -> Scenario {
    let mut scenario = scenario.clone();
    let new = condition(rng);
    let place = rng.random_range(0..=scenario.problem.schemas.len());
    let conditions = match scenario.problem.schemas.get_mut(place).map(|s| &mut s.body) {
        None => &mut scenario.problem.goal,
        Some(Body::Instantaneous { condition, .. }) => condition,
        Some(Body::Durative {
            at_start,
            over_all,
            at_end,
            ..
        }) => match rng.random_range(0..4) {
            0 => at_start,
            1 => at_end,
            _ => over_all,
        },
    };
    *conditions = Condition::And(vec![std::mem::take(conditions), new]);
    scenario
}

/// Returns a valid plan with as many conditions as were found to hold.
pub(super) fn scenario(rng: &mut ChaCha8Rng, is_timeless: bool) -> Scenario {
    let mut scenario = loop {
        let scenario = effects_only(rng, is_timeless);
        if scenario.is_valid() {
            break scenario;
        }
    };
    for _ in 0..25 {
        let more = with_condition(&scenario, rng);
        if more.is_valid() {
            scenario = more;
        }
    }
    scenario
}
