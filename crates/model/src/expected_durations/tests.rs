//! Durations of grounded actions with expected durations.

use elbowroom_num::Rational;

use crate::expression::Comparison;
use crate::ground::{DurationConstraint, Expression};
use crate::pattern::ActionPattern;
use crate::problem::{
    Body, Condition, ExpectedDuration, ExpectedDurations, Problem, Schema, SchemaId,
};
use crate::problem::{DurationConstraint as Lifted, Expression as LiftedExpression};
use crate::{Task, validate};

fn number(value: i64) -> Rational {
    Rational::from(value)
}

/// Returns a task with one action, with these constraints on its duration and this condition at its start.
fn task(duration: Vec<Lifted>, at_start: Condition) -> Task {
    let body = Body::Durative {
        duration,
        at_start,
        over_all: Condition::TRUE,
        at_end: Condition::TRUE,
        start_effects: Vec::new(),
        end_effects: Vec::new(),
        continuous: Vec::new(),
    };
    Task::new(Problem {
        schemas: vec![Schema {
            name: "go".to_owned(),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body,
        }],
        ..Problem::default()
    })
}

fn bound(comparison: Comparison, bound: LiftedExpression) -> Lifted {
    Lifted {
        comparison,
        bound,
        at_end: false,
    }
}

fn rules(rules: &[(&str, i64, i64)]) -> ExpectedDurations {
    let rule = |&(name, factor, seconds): &(&str, i64, i64)| ExpectedDuration {
        actions: ActionPattern::new((name != "*").then(|| name.to_owned()), None),
        factor: number(factor),
        seconds: number(seconds),
    };
    ExpectedDurations {
        rules: rules.iter().map(rule).collect(),
        ..ExpectedDurations::default()
    }
}

fn durations(task: &Task) -> Vec<DurationConstraint> {
    let action = task.instantiate(SchemaId(0), &[]).expect("no parameters");
    action
        .durative()
        .expect("a durative action")
        .duration
        .clone()
}

fn ten() -> Vec<Lifted> {
    vec![bound(
        Comparison::Equal,
        LiftedExpression::Constant(number(10)),
    )]
}

#[test]
fn last_matching_rule_replaces_fixed_duration() {
    let domain = task(ten(), Condition::TRUE);
    for (given, expected) in [
        (&[("go", 2, 0)][..], 20),
        (&[("go", 0, 26)], 26),
        (&[("go", 2, 1)], 21),
        (&[("go", 2, 0), ("*", 3, 0)], 30),
        (&[("*", 3, 0), ("stay", 2, 0)], 30),
        (&[("stay", 2, 0)], 10),
    ] {
        let task = domain.with_expected_durations(rules(given));
        assert_eq!(
            durations(&task)[0].bound,
            Expression::Constant(number(expected)),
            "{given:?}"
        );
        assert_eq!(durations(&task.with_domain_durations()), durations(&domain));
    }
}

#[test]
fn ranges_and_durations_read_before_the_end_stay_as_they_are() {
    let constant = |value| LiftedExpression::Constant(number(value));
    let range = vec![
        bound(Comparison::AtLeast, constant(5)),
        bound(Comparison::AtMost, constant(10)),
    ];
    let reads = Condition::Compare(Comparison::AtMost, LiftedExpression::Duration, constant(10));
    for domain in [task(range, Condition::TRUE), task(ten(), reads)] {
        let task = domain.with_expected_durations(rules(&[("go", 2, 0)]));
        assert_eq!(durations(&task), durations(&domain));
    }
}

#[test]
fn executions_are_validated_with_durations_of_the_domain() {
    let task = task(ten(), Condition::TRUE).with_expected_durations(rules(&[("go", 2, 0)]));
    let go = std::sync::Arc::new(task.instantiate(SchemaId(0), &[]).expect("no parameters"));
    for (duration, is_valid) in [(10, true), (20, false)] {
        let mut execution = validate::Execution::new(&task);
        let commanded = execution.command(0, &go, Some(&number(duration)));
        assert_eq!(commanded.is_ok(), is_valid, "{commanded:?}");
    }
}
