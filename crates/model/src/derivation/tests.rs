//! Comparison of strata and counting with relaxation and the naive fixpoint; long chains and wide
//! cycles.

mod naive;

use std::collections::BTreeMap;
use std::sync::Arc;

use proptest::prelude::*;

use super::{Derivation, Moment, Rules};
use crate::ground::{Condition, Expression, FactId};
use crate::plan::{Step, TimeTriggeredPlan};
use crate::problem::{self, Atom, Comparison, Predicate, PredicateId, Problem, Schema};
use crate::task::Task;
use crate::validate::{Settings, Verdict, validate};

/// Facts 0 to 3 are basic: true, false, undefined, and undefined for another reason.
const BASIC: u32 = 4;
/// The facts after them, in groups of three that mostly negate lower groups only.
const DERIVED: u32 = 9;

struct Basic;

impl Moment<u32> for Basic {
    fn fact(&self, fact: FactId) -> Result<bool, u32> {
        match fact.0 {
            0 => Ok(true),
            1 => Ok(false),
            other => Err(other),
        }
    }

    fn compare(&self, _: Comparison, _: &Expression, _: &Expression) -> Result<bool, u32> {
        unreachable!("no rule here compares numbers")
    }
}

/// Generates bodies whose negated facts are below `negatable`.
fn body(negatable: u32) -> impl Strategy<Value = Condition> {
    let fact = |number| Condition::Fact(FactId(number));
    let leaf = prop_oneof![
        4 => (0..BASIC + DERIVED).prop_map(fact),
        1 => (0..negatable).prop_map(move |number| Condition::Not(Box::new(fact(number)))),
    ];
    leaf.prop_recursive(3, 12, 3, |inner| {
        let parts = prop::collection::vec(inner, 0..4);
        prop_oneof![
            parts.clone().prop_map(Condition::And),
            parts.clone().prop_map(Condition::Or),
            // The only double negations.
            parts.prop_map(|parts| {
                let negate = |part| Condition::Not(Box::new(part));
                negate(Condition::Or(parts.into_iter().map(negate).collect()))
            }),
        ]
    })
}

/// Generates rules for each derived fact. Positive facts may be above their group, so that some
/// rule sets have a fact that depends on its own negation.
fn rule_sets() -> impl Strategy<Value = Rules> {
    let bodies_of = |head: u32| prop::collection::vec(body(BASIC + head / 3 * 3), 0..3);
    let all: Vec<_> = (0..DERIVED).map(bodies_of).collect();
    all.prop_map(|all| {
        let mut rules = Rules::default();
        for (head, bodies) in (BASIC..BASIC + DERIVED).zip(all).rev() {
            rules.add(FactId(head), bodies);
        }
        rules
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn strata_exist_exactly_if_relaxation_finds_levels(rules in rule_sets()) {
        let is_stratified = naive::levels(&rules).is_some();
        prop_assert_eq!(Derivation::of(&Arc::new(rules)).is_some(), is_stratified);
    }

    #[test]
    fn counting_derives_same_facts_as_naive_fixpoint(rules in rule_sets()) {
        let rules = Arc::new(rules);
        let Some(derivation) = Derivation::of(&rules) else { return Ok(()) };
        let derived = derivation.derive(&Basic);
        let levels = naive::levels(&rules).expect("as there are strata");
        let expected = naive::derive(&rules, &levels, &Basic);
        let found: BTreeMap<_, _> = rules
            .heads()
            .map(|head| (head, derived.truth(head).ok()))
            .collect();
        prop_assert_eq!(found, expected);
    }
}

#[test]
fn first_rule_reports_its_fault_if_two_rules_fail() {
    let mut rules = Rules::default();
    let fact = |number| Condition::Fact(FactId(number));
    rules.add(FactId(4), vec![fact(1), fact(3), fact(2)]);
    let derivation = Derivation::of(&Arc::new(rules)).expect("no negation");
    let derived = derivation.derive(&Basic);
    assert_eq!(derived.truth(FactId(4)), Err(3));
}

/// Validates a plan with the action `go`. Predicate 0 is basic and true, the others are derived
/// with one rule each; `go` needs predicate 0, the goal is `goal`.
fn verdict(bodies: Vec<problem::Condition>, goal: problem::Condition) -> Verdict {
    let predicates = (0..=bodies.len()).map(|number| Predicate {
        name: format!("p{number}"),
        parameters: Vec::new(),
        is_derived: number > 0,
    });
    let rules = bodies.into_iter().enumerate().map(|(number, body)| {
        let predicate = PredicateId::from(number + 1);
        problem::Rule {
            predicate,
            parameters: Vec::new(),
            body,
        }
    });
    let task = Task::new(Problem {
        predicates: predicates.collect(),
        rules: rules.collect(),
        initial_facts: vec![(PredicateId(0), Vec::new())],
        goal,
        schemas: vec![Schema {
            name: "go".to_owned(),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body: problem::Body::Instantaneous {
                condition: lifted(0),
                effects: Vec::new(),
            },
        }],
        ..Problem::default()
    });
    let action = task.instantiate(problem::SchemaId(0), &[]).expect("go");
    let steps = vec![Step {
        start: 1.into(),
        action: Arc::new(action),
        duration: None,
    }];
    validate(&task, &TimeTriggeredPlan { steps }, &Settings::default())
}

fn lifted(number: usize) -> problem::Condition {
    problem::Condition::Atom(Atom {
        predicate: PredicateId::from(number),
        arguments: Vec::new(),
    })
}

const LENGTH: usize = 100_000;

#[test]
fn chain_of_a_hundred_thousand_rules_is_evaluated() {
    let upwards = (0..LENGTH).map(lifted).collect();
    assert!(verdict(upwards, lifted(LENGTH)).is_valid());
}

#[test]
fn reversed_chain_of_rules_is_evaluated() {
    // p1 <- p2, p2 <- p3, …, and the last one depends on p0.
    let downwards = (2..=LENGTH).chain([0]).map(lifted).collect();
    assert!(verdict(downwards, lifted(1)).is_valid());
}

#[test]
fn cycle_of_a_hundred_thousand_rules_derives_no_fact() {
    let ring = (2..=LENGTH).chain([1]).map(lifted).collect();
    let not_first = problem::Condition::Not(Box::new(lifted(1)));
    assert!(verdict(ring, not_first).is_valid());
}

#[test]
fn cyclic_reachability_rules_on_grid_are_evaluated() {
    // Each cell is reached from its neighbours in all directions, the last one from outside. A
    // second grid after it has no connection.
    let side = 50;
    let cells = side * side;
    let neighbours = |cell: usize| {
        let (row, column) = (cell / side, cell % side);
        let mut found = Vec::new();
        found.extend((row > 0).then(|| cell - side));
        found.extend((row + 1 < side).then_some(cell + side));
        found.extend((column > 0).then(|| cell - 1));
        found.extend((column + 1 < side).then_some(cell + 1));
        found
    };
    let grid = |first: usize, is_open: bool| {
        (0..cells).map(move |cell| {
            let mut ways: Vec<_> = neighbours(cell)
                .into_iter()
                .map(|other| problem::Condition::And(vec![lifted(0), lifted(first + other)]))
                .collect();
            if is_open && cell + 1 == cells {
                ways.push(lifted(0));
            }
            problem::Condition::Or(ways)
        })
    };
    let bodies = grid(1, true).chain(grid(cells + 1, false)).collect();
    let all = (1..=cells).map(lifted);
    let none = (cells + 1..=2 * cells).map(|cell| problem::Condition::Not(Box::new(lifted(cell))));
    let goal = problem::Condition::And(all.chain(none).collect());
    assert!(verdict(bodies, goal).is_valid());
}

#[test]
fn long_negative_cycle_is_reported() {
    let mut bodies: Vec<_> = (2..=LENGTH).map(lifted).collect();
    bodies.push(problem::Condition::Not(Box::new(lifted(1))));
    assert!(matches!(
        verdict(bodies, lifted(1)),
        Verdict::Undecided(undecided) if undecided.to_string().contains("its own negation")
    ));
}
