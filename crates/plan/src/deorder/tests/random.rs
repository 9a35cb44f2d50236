//! Deordering against the judge, on problems made so that a random plan is valid.
//!
//! A random plan of random effects comes first. Then conditions are added one at a time, each of
//! which the judge finds to hold in that plan; so they are many, and tight. Whatever schedule the
//! deordered plan has, the judge must find them to hold in it as well.

use elbowroom_model::problem::{
    Atom, Body, Change, Comparison, Condition, ContinuousEffect, DurationConstraint, Effect,
    Expression, Fluent, Function, FunctionId, Guard, Predicate, PredicateId, Problem, Schema,
    SchemaId, TimedChange, TimedInitial, Type, UpdateOperator,
};
use elbowroom_model::{Step, Task, TimeTriggeredPlan, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_stn::{ConsistentNetwork, Constraint};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::deorder::{Deordered, Settings, deorder, pin_until_sound, pinned_to};
use crate::soundness::Soundness;
use crate::{DecoupledEnvelope, NodeId, ParametrizedPlan, Schedule, StnPlan, network_node};

const FACTS: u32 = 4;
const FLUENTS: u32 = 3;

/// A problem of actions without parameters, and when its plan does each of them, for how long.
#[derive(Clone)]
struct Scenario {
    problem: Problem,
    times: Vec<(Rational, Option<Rational>)>,
}

impl Scenario {
    fn task(&self) -> Task {
        Task::new(self.problem.clone())
    }

    fn plan(&self, task: &mut Task) -> TimeTriggeredPlan {
        let steps = self
            .times
            .iter()
            .enumerate()
            .map(|(index, (start, duration))| Step {
                start: start.clone(),
                action: task.instantiate(SchemaId::from(index), &[]).unwrap(),
                duration: duration.clone(),
            });
        TimeTriggeredPlan {
            steps: steps.collect(),
        }
    }

    fn is_valid(&self) -> bool {
        let mut task = self.task();
        let plan = self.plan(&mut task);
        validate(
            &task,
            &plan,
            &elbowroom_model::validate::Settings::default(),
        )
        .is_valid()
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

/// A time on a grid, so that happenings often coincide.
fn time(rng: &mut ChaCha8Rng, most: i64) -> Rational {
    Rational::new(rng.random_range(1..=2 * most), 2)
}

fn effects(rng: &mut ChaCha8Rng, is_timeless: bool) -> Vec<Effect> {
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
                    .unwrap()
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
            guard: Guard::default(),
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
                .unwrap(),
            bound: Expression::Fluent(fluent(rng)),
            at_end: rng.random(),
        }],
        _ => Vec::new(),
    }
}

/// Effects and times at random; `is_timeless`: no value depends on when things happen.
fn effects_only(rng: &mut ChaCha8Rng, is_timeless: bool) -> Scenario {
    let mut schemas = Vec::new();
    let mut times = Vec::new();
    for index in 0..rng.random_range(1..7) {
        let is_durative = rng.random_bool(0.8);
        let duration = is_durative.then(|| time(rng, 4));
        let body = match &duration {
            None => Body::Instantaneous {
                condition: Condition::TRUE,
                effects: effects(rng, true),
            },
            Some(duration) => Body::Durative {
                duration: duration_constraints(rng, duration),
                at_start: Condition::TRUE,
                over_all: Condition::TRUE,
                at_end: Condition::TRUE,
                start_effects: effects(rng, is_timeless),
                end_effects: effects(rng, is_timeless),
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
    let timed = (0..rng.random_range(0..4)).map(|_| TimedInitial {
        time: time(rng, 12),
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
        timed: timed.collect(),
        schemas,
        initial_facts: vec![(PredicateId(0), Vec::new()), (PredicateId(1), Vec::new())],
        initial_values: (0..FLUENTS)
            .map(|index| (FunctionId(index), Vec::new(), Rational::from(5)))
            .collect(),
        ..Problem::default()
    };
    Scenario { problem, times }
}

fn condition(rng: &mut ChaCha8Rng) -> Condition {
    let atom = Condition::Atom(fact(rng));
    match rng.random_range(0..4) {
        0 => atom,
        1 => Condition::Not(Box::new(atom)),
        _ => Condition::Compare(
            *[Comparison::AtMost, Comparison::AtLeast, Comparison::Equal]
                .choose(rng)
                .unwrap(),
            Expression::Fluent(fluent(rng)),
            integer(rng.random_range(-2..12)),
        ),
    }
}

/// The scenario with one condition more, somewhere.
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

/// A valid plan with as many conditions as were found to hold.
fn scenario(rng: &mut ChaCha8Rng, is_timeless: bool) -> Scenario {
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

/// A schedule whose nodes, in random order, take an end or a random point of their windows.
fn draw(plan: &StnPlan, rng: &mut ChaCha8Rng) -> Schedule {
    let zero = network_node(NodeId::ZERO);
    let mut network = ConsistentNetwork::try_from(plan.network(&[])).unwrap();
    let mut nodes: Vec<_> = network.network().nodes().skip(1).collect();
    nodes.shuffle(rng);
    for node in nodes {
        let windows = network.windows(zero);
        let earliest = windows[node].earliest.clone().unwrap();
        let latest = windows[node].latest.clone();
        let latest = latest.unwrap_or_else(|| &earliest + time(rng, 20));
        let share = *[0, 0, 1, 2, 4, 4].choose(rng).unwrap();
        let at = &earliest + (latest - &earliest) * Rational::new(share, 4);
        network
            .add(Constraint::at_least(zero, node, at.clone()))
            .unwrap();
        network.add(Constraint::at_most(zero, node, at)).unwrap();
    }
    network.schedule().relative_to(zero).times().to_vec()
}

fn assert_sound(seed: u64, task: &Task, plan: &StnPlan, rng: &mut ChaCha8Rng) {
    for _ in 0..12 {
        let fixed = plan.scheduled(&draw(plan, rng));
        let verdict = validate(
            task,
            &fixed,
            &elbowroom_model::validate::Settings::default(),
        );
        if let Verdict::Invalid(violation) = verdict {
            panic!("seed {seed}: {violation}\n{:#?}", fixed.steps);
        }
    }
}

#[test]
fn all_schedules_are_valid_where_no_value_depends_on_time() {
    for seed in 0..600 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let scenario = scenario(&mut rng, true);
        let mut task = scenario.task();
        let plan = scenario.plan(&mut task);
        let deordered = deorder(&task, &plan, &Settings::default());
        let Deordered { plan, .. } = deordered.unwrap_or_else(|error| panic!("{seed}: {error}"));
        assert_sound(seed, &task, &plan, &mut rng);
    }
}

#[test]
fn with_pins_all_schedules_are_valid_where_values_depend_on_time() {
    let (mut pinned, mut untold) = (0, 0);
    for seed in 0..400 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let scenario = scenario(&mut rng, false);
        let mut task = scenario.task();
        let plan = scenario.plan(&mut task);
        let deordered = deorder(&task, &plan, &Settings::default());
        let Deordered { plan, nominal } =
            deordered.unwrap_or_else(|error| panic!("{seed}: {error}"));
        let sound = pin_until_sound(plan.clone(), &nominal, &mut |plan| {
            let closed = ParametrizedPlan::closed(&task, plan.clone());
            let mut soundness =
                Soundness::new(&task, &closed, &Settings::default().epsilon).ok()?;
            let broken = soundness
                .broken(&DecoupledEnvelope::point(&[]), None)
                .ok()??;
            let differences = broken.case.differences.iter();
            let nodes = differences.flat_map(|difference| [difference.from, difference.to]);
            let inequalities = broken.case.inequalities.iter();
            let others = inequalities.flat_map(|inequality| inequality.expression.times.keys());
            let all = nodes.chain(others.copied());
            Some(all.filter(|node| node.index() < plan.nodes.len()).collect())
        });
        let is_told = {
            let closed = ParametrizedPlan::closed(&task, plan.clone());
            Soundness::new(&task, &closed, &Settings::default().epsilon).is_ok()
        };
        untold += usize::from(!is_told);
        let sound = match sound {
            Some(sound) if is_told => sound,
            _ => pinned_to(plan.clone(), &nominal),
        };
        pinned += usize::from(sound != plan);
        assert_sound(seed, &task, &sound, &mut rng);
    }
    assert!(pinned > 0, "the scenarios are too easy");
    println!("{pinned} of 400 plans needed pins; of {untold} nothing could be told");
}
