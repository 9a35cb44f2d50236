//! A small domain for the tests of this crate: a rover that navigates, collects, refuels, beeps.

use elbowroom_model::Task;
use elbowroom_model::problem::{
    Atom, Body, Change, Comparison, Condition, ContinuousEffect, DurationConstraint, Effect,
    Expression, Fluent, Function, FunctionId, Guard, Object, ObjectId, Predicate, PredicateId,
    Problem, Schema, Term, TimedChange, TimedInitial, Type, TypeId, Unknown, UpdateOperator,
    Variable,
};
use elbowroom_num::Rational;

/// Parses a number.
pub(crate) fn number(text: &str) -> Rational {
    text.parse().unwrap()
}

fn variable(name: &str) -> Variable {
    Variable {
        name: name.to_owned(),
        types: vec![TypeId(1)],
    }
}

fn atom(predicate: u32, arguments: Vec<Term>) -> Atom {
    Atom {
        predicate: PredicateId(predicate),
        arguments,
    }
}

fn effect(change: Change) -> Effect {
    Effect {
        variables: Vec::new(),
        guard: Guard::default(),
        change,
    }
}

fn fluent(function: u32) -> Fluent {
    Fluent {
        function: FunctionId(function),
        arguments: Vec::new(),
    }
}

fn limit(comparison: Comparison, bound: Expression) -> DurationConstraint {
    DurationConstraint {
        comparison,
        bound,
        at_end: false,
    }
}

fn schema(name: &str, parameters: &[&str], unknowns: &[&str], body: Body) -> Schema {
    Schema {
        name: name.to_owned(),
        parameters: parameters.iter().map(|name| variable(name)).collect(),
        unknowns: unknowns.iter().map(|&name| name.to_owned()).collect(),
        body,
    }
}

fn schemas() -> Vec<Schema> {
    let constant = |value: i64| Expression::Constant(Rational::from(value));
    let update = |operator, function, value| {
        effect(Change::Update {
            operator,
            fluent: fluent(function),
            value,
        })
    };
    let not_navigating = Condition::Not(Box::new(Condition::Atom(atom(0, vec![]))));
    let navigate = Body::Durative {
        duration: vec![
            limit(Comparison::AtLeast, constant(5)),
            limit(Comparison::AtMost, constant(15)),
        ],
        at_start: not_navigating.clone(),
        over_all: Condition::TRUE,
        at_end: Condition::TRUE,
        start_effects: vec![effect(Change::Add(atom(0, vec![])))],
        end_effects: vec![effect(Change::Delete(atom(0, vec![])))],
        continuous: vec![ContinuousEffect {
            variables: Vec::new(),
            guard: Guard::default(),
            fluent: fluent(0),
            rate: Expression::Unknown(Unknown::Domain(0)),
        }],
    };
    let collected = atom(1, vec![Term::Variable(0)]);
    let collect = Body::Durative {
        duration: vec![limit(Comparison::Equal, Expression::Fluent(fluent(1)))],
        at_start: Condition::TRUE,
        over_all: not_navigating,
        at_end: Condition::TRUE,
        start_effects: Vec::new(),
        end_effects: vec![effect(Change::Add(collected))],
        continuous: Vec::new(),
    };
    let refuel = Body::Durative {
        duration: vec![limit(Comparison::Equal, constant(10))],
        at_start: Condition::Compare(
            Comparison::AtLeast,
            Expression::Fluent(fluent(2)),
            constant(3),
        ),
        over_all: Condition::TRUE,
        at_end: Condition::TRUE,
        start_effects: vec![update(UpdateOperator::Decrease, 2, constant(3))],
        end_effects: vec![update(
            UpdateOperator::Increase,
            2,
            Expression::Unknown(Unknown::Action(0)),
        )],
        continuous: Vec::new(),
    };
    let beep = Body::Instantaneous {
        condition: Condition::Atom(atom(2, vec![])),
        effects: vec![update(UpdateOperator::Increase, 0, constant(2))],
    };
    vec![
        schema("navigate", &[], &[], navigate),
        schema("collect", &["?x"], &[], collect),
        schema("refuel", &["?x"], &["?r"], refuel),
        schema("beep", &[], &[], beep),
    ]
}

/// Returns the task of this domain and problem:
///
/// ```text
/// (:synth-parameters ?s)
/// (:durative-action navigate :parameters ()
///   :duration (and (>= ?duration 5) (<= ?duration 15))
///   :condition (at start (not (navigating)))
///   :effect (and (at start (navigating)) (at end (not (navigating)))
///                (increase (distance) (* #t ?s))))
/// (:durative-action collect :parameters (?x - sample)
///   :duration (= ?duration (collection-time))
///   :condition (over all (not (navigating)))
///   :effect (at end (collected ?x)))
/// (:durative-action refuel :parameters (?x - sample) :synth-parameters (?r)
///   :duration (= ?duration 10)
///   :condition (at start (>= (fuel) 3))
///   :effect (and (at start (decrease (fuel) 3)) (at end (increase (fuel) ?r))))
/// (:action beep :parameters ()
///   :precondition (open) :effect (increase (distance) 2))
/// (:init (= (collection-time) 15) (= (distance) 0) (= (fuel) 7) (open) (at 100 (not (open))))
/// (:goal (and (collected S1)))
/// ```
pub(crate) fn rover() -> Task {
    let predicate = |name: &str, parameters: Vec<Variable>| Predicate {
        name: name.to_owned(),
        parameters,
        is_derived: false,
    };
    let function = |name: &str| Function {
        name: name.to_owned(),
        parameters: Vec::new(),
    };
    let object = |name: &str| Object {
        name: name.to_owned(),
        types: vec![TypeId(1)],
    };
    Task::new(Problem {
        types: vec![
            Type {
                name: "object".to_owned(),
                parents: Vec::new(),
            },
            Type {
                name: "sample".to_owned(),
                parents: vec![TypeId::OBJECT],
            },
        ],
        objects: vec![object("S1"), object("s2")],
        predicates: vec![
            predicate("navigating", Vec::new()),
            predicate("collected", vec![variable("?x")]),
            predicate("open", Vec::new()),
        ],
        functions: vec![
            function("distance"),
            function("collection-time"),
            function("fuel"),
        ],
        schemas: schemas(),
        unknowns: vec!["?s".to_owned()],
        initial_facts: vec![(PredicateId(2), Vec::new())],
        initial_values: vec![
            (FunctionId(0), Vec::new(), Rational::ZERO),
            (FunctionId(1), Vec::new(), Rational::from(15)),
            (FunctionId(2), Vec::new(), Rational::from(7)),
        ],
        timed: vec![TimedInitial {
            time: Rational::from(100),
            change: TimedChange::Delete(PredicateId(2), Vec::new()),
        }],
        goal: Condition::Atom(atom(1, vec![Term::Object(ObjectId(0))])),
        ..Problem::default()
    })
}
