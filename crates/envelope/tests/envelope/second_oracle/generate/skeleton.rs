//! Actions with effects only, and timed initials.

use elbowroom_model::Problem;
use elbowroom_model::problem::{
    Atom, Body, Change, Comparison, Condition, ContinuousEffect, Effect, Expression, Fluent,
    Function, FunctionId, Guard, Predicate, PredicateId, Rule, Schema, TimedChange, TimedInitial,
    Type, UpdateOperator,
};
use elbowroom_num::Rational;

use super::Theme;
use crate::second_oracle::random::Random;

/// Generates actions with effects only, and timed initials.
pub(super) fn skeleton(dice: &mut Random, theme: Theme) -> Problem {
    let (facts, fluents) = (1 + dice.below(3), 1 + dice.below(2));
    let name = |prefix: &str, index: usize| format!("{prefix}{index}");
    let mut problem = Problem {
        types: vec![Type {
            name: "object".to_owned(),
            parents: Vec::new(),
        }],
        predicates: (0..facts)
            .map(|index| Predicate {
                name: name("p", index),
                parameters: Vec::new(),
                is_derived: false,
            })
            .collect(),
        functions: (0..fluents)
            .map(|index| Function {
                name: name("x", index),
                parameters: Vec::new(),
            })
            .collect(),
        ..Problem::default()
    };
    for fact in 0..facts {
        if dice.chance(50) {
            problem
                .initial_facts
                .push((PredicateId::from(fact), Vec::new()));
        }
    }
    for fluent in 0..fluents {
        if dice.chance(97) {
            let value = dice.half(0, 10);
            let entry = (FunctionId::from(fluent), Vec::new(), value);
            problem.initial_values.push(entry);
        }
    }
    for index in 0..*dice.pick(&[2, 2, 3, 3, 3, 4, 4, 5]) {
        let body = body(dice, facts, fluents, theme);
        problem.schemas.push(Schema {
            name: name("a", index),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body,
        });
    }
    if dice.chance(25) {
        derive(dice, &mut problem);
    }
    let mut time = Rational::ZERO;
    let timed: &[usize] = if theme == Theme::Timed {
        &[2, 3]
    } else {
        &[0, 0, 1, 1, 2]
    };
    for _ in 0..*dice.pick(timed) {
        time += if dice.chance(15) {
            Rational::new(1, 8)
        } else {
            dice.half(1, if theme == Theme::Timed { 3 } else { 6 })
        };
        for _ in 0..=dice.below(2) {
            problem.timed.push(TimedInitial {
                time: time.clone(),
                change: timed_change(dice, facts, fluents),
            });
        }
    }
    problem
}

/// Adds a derived predicate over the others, and sometimes over a number.
fn derive(dice: &mut Random, problem: &mut Problem) {
    let facts = problem.predicates.len();
    problem.predicates.push(Predicate {
        name: "derived".to_owned(),
        parameters: Vec::new(),
        is_derived: true,
    });
    let has_values = problem.initial_values.len() == problem.functions.len();
    for _ in 0..=dice.below(2) {
        let fluents = problem.functions.len();
        let part = |dice: &mut Random| {
            if has_values && dice.chance(10) {
                let left = Expression::Fluent(fluent(dice.below(fluents)));
                Condition::Compare(Comparison::AtLeast, left, constant(dice.half(0, 10)))
            } else {
                fact(dice, facts)
            }
        };
        let parts = vec![part(dice), part(dice)];
        problem.rules.push(Rule {
            predicate: PredicateId::from(facts),
            parameters: Vec::new(),
            body: if dice.chance(50) {
                Condition::And(parts)
            } else {
                Condition::Or(parts)
            },
        });
    }
}

/// Generates a fact or its negation.
pub(super) fn fact(dice: &mut Random, facts: usize) -> Condition {
    let atom = Condition::Atom(atom(dice.below(facts)));
    if dice.chance(50) {
        atom
    } else {
        Condition::Not(Box::new(atom))
    }
}

fn timed_change(dice: &mut Random, facts: usize, fluents: usize) -> TimedChange {
    let fact = PredicateId::from(dice.below(facts));
    match dice.below(3) {
        0 => TimedChange::Add(fact, Vec::new()),
        1 => TimedChange::Delete(fact, Vec::new()),
        _ => {
            let fluent = FunctionId::from(dice.below(fluents));
            TimedChange::Assign(fluent, Vec::new(), dice.half(0, 10))
        }
    }
}

fn body(dice: &mut Random, facts: usize, fluents: usize, theme: Theme) -> Body {
    if dice.chance(30) {
        return Body::Instantaneous {
            condition: Condition::TRUE,
            effects: effects(dice, facts, fluents, (false, theme)),
        };
    }
    let continuous = if dice.chance(if theme == Theme::Rates { 90 } else { 40 }) {
        vec![ContinuousEffect {
            variables: Vec::new(),
            guard: if dice.chance(guarded(theme) / 2) {
                Guard {
                    at_start: literal(dice, facts, fluents),
                    ..Guard::default()
                }
            } else {
                Guard::default()
            },
            fluent: fluent(dice.below(fluents)),
            rate: rate(dice, fluents),
        }]
    } else {
        Vec::new()
    };
    let start_effects = effects(dice, facts, fluents, (true, theme));
    let mut end_effects = effects(dice, facts, fluents, (true, theme));
    for effect in &mut end_effects {
        if dice.chance(guarded(theme)) {
            effect.guard.at_start = literal(dice, facts, fluents);
        }
    }
    Body::Durative {
        duration: Vec::new(),
        at_start: Condition::TRUE,
        over_all: Condition::TRUE,
        at_end: Condition::TRUE,
        start_effects,
        end_effects,
        continuous,
    }
}

/// Returns the percentage of effects that depend on a condition.
fn guarded(theme: Theme) -> usize {
    if theme == Theme::Guards { 40 } else { 4 }
}

fn rate(dice: &mut Random, fluents: usize) -> Expression {
    let number = constant(dice.pick(&[1, 1, 2, -1, -2]).to_owned().into());
    match dice.below(12) {
        0 => Expression::Fluent(fluent(dice.below(fluents))),
        1 => Expression::Multiply(vec![number, constant(dice.half(1, 2))]),
        2 => Expression::Add(vec![
            number,
            Expression::Fluent(fluent(dice.below(fluents))),
        ]),
        _ => number,
    }
}

fn effects(
    dice: &mut Random,
    facts: usize,
    fluents: usize,
    (is_durative, theme): (bool, Theme),
) -> Vec<Effect> {
    let count = *dice.pick(&[0, 1, 1, 2]);
    let effect = |dice: &mut Random| {
        let guard = if dice.chance(guarded(theme)) {
            Guard {
                now: literal(dice, facts, fluents),
                ..Guard::default()
            }
        } else {
            Guard::default()
        };
        let change = match dice.below(10) {
            0..=2 => Change::Add(atom(dice.below(facts))),
            3..=4 => Change::Delete(atom(dice.below(facts))),
            which => Change::Update {
                operator: match which {
                    5..=6 => UpdateOperator::Increase,
                    7..=8 => UpdateOperator::Decrease,
                    _ if dice.chance(10) => UpdateOperator::ScaleUp,
                    _ if dice.chance(10) => UpdateOperator::ScaleDown,
                    _ => UpdateOperator::Assign,
                },
                fluent: fluent(dice.below(fluents)),
                value: amount(dice, fluents, is_durative),
            },
        };
        Effect {
            variables: Vec::new(),
            guard,
            change,
        }
    };
    (0..count).map(|_| effect(dice)).collect()
}

fn amount(dice: &mut Random, fluents: usize, is_durative: bool) -> Expression {
    let number = constant(dice.half(0, 4));
    match dice.below(12) {
        0 if is_durative => Expression::Duration,
        1 if is_durative => Expression::Multiply(vec![number, Expression::Duration]),
        2 if is_durative => Expression::Add(vec![Expression::Duration, number]),
        3 => Expression::Fluent(fluent(dice.below(fluents))),
        4 => Expression::Subtract(
            Box::new(number),
            Box::new(Expression::Fluent(fluent(dice.below(fluents)))),
        ),
        _ => number,
    }
}

fn literal(dice: &mut Random, facts: usize, fluents: usize) -> Condition {
    if dice.chance(70) {
        fact(dice, facts)
    } else {
        let comparison = *dice.pick(&[Comparison::AtLeast, Comparison::Less]);
        let left = Expression::Fluent(fluent(dice.below(fluents)));
        Condition::Compare(comparison, left, constant(dice.half(0, 10)))
    }
}

pub(super) fn constant(value: Rational) -> Expression {
    Expression::Constant(value)
}

pub(super) fn atom(fact: usize) -> Atom {
    Atom {
        predicate: PredicateId::from(fact),
        arguments: Vec::new(),
    }
}

pub(super) fn fluent(function: usize) -> Fluent {
    Fluent {
        function: FunctionId::from(function),
        arguments: Vec::new(),
    }
}
