//! `:control` parameters: numbers that a plan chooses for each of its actions.

use crate::reading::{mistakes, read_actions, task};
use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_pddl::{Source, read_plan, write_plan};
use insta::assert_snapshot;

fn cash() -> Task {
    let domain = "(define (domain d) (:types person)
        (:functions (pocket ?p - person) (left))
        (:durative-action withdraw :parameters (?p - person) :control (?cash ?fee - number)
          :duration (>= ?duration ?fee)
          :condition (and (at start (<= ?cash 10)) (at start (>= (left) ?cash)))
          :effect (and (at start (decrease (left) ?cash)) (at end (increase (pocket ?p) ?cash)))))";
    let problem = "(define (problem p) (:domain d) (:objects ann - person)
        (:init (= (pocket ann) 0) (= (left) 15)) (:goal (>= (pocket ann) 12)))";
    task(
        &Source::new("domain.pddl", domain),
        &Source::new("problem.pddl", problem),
    )
}

fn verdict_on(plan: &str) -> String {
    let task = cash();
    let (plan, _) = match read_plan(&Source::new("plan", plan), &task) {
        Ok(read) => read,
        Err(diagnostics) => return diagnostics.to_string(),
    };
    match validate(&task, &plan, &Settings::default()) {
        Verdict::Valid(_) => format!("valid\n{}", write_plan(&task, &plan)),
        Verdict::Invalid(violation) => violation.to_string(),
        Verdict::Undecided(undecided) => format!("undecided: {undecided}"),
    }
}

#[test]
fn control_numbers_follow_objects() {
    assert_snapshot!(verdict_on("0: (withdraw ann 10 2) [2]\n3: (withdraw ann 2.5 0) [1]"), @r#"
valid
0.000: (withdraw ann 10.000 2.000) [2.000]
3.000: (withdraw ann 2.500 0.000) [1.000]
"#);
}

#[test]
fn validator_uses_chosen_control_numbers() {
    assert_snapshot!(verdict_on("0: (withdraw ann 11 2) [2]"), @"at 0.000: (withdraw ann 11.000 2.000) needs (<= 11 10) at start: (<= 11 10) is false, short by 1");
    assert_snapshot!(verdict_on("0: (withdraw ann 10 3) [2]"), @"at 0.000: (withdraw ann 10.000 3.000) takes 2, but its duration must be >= 3");
    assert_snapshot!(verdict_on("0: (withdraw ann 10 1) [2]\n3: (withdraw ann 6 0) [1]"), @"at 3.000: (withdraw ann 6.000 0.000) needs (>= (left) 6) at start: (left) = 5, short by 1");
    assert_snapshot!(verdict_on("0: (withdraw ann 10 1) [2]\n3: (withdraw ann 1 0) [1]"), @"at 4.000: the goal (>= (pocket ann) 12) does not hold: (pocket ann) = 11, short by 1");
}

#[test]
fn missing_or_malformed_control_number_is_reported() {
    assert_snapshot!(verdict_on("0: (withdraw ann 10) [2]"), @"plan:1:5: error: `withdraw` chooses 1 of its 2 numbers here; expected `(withdraw ?p - person ?cash - number ?fee - number)`, with the numbers after the objects");
    assert_snapshot!(verdict_on("0: (withdraw ann ten 0) [2]"), @"plan:1:18: error: `ten` is not a number: write a decimal such as 12.5 or a fraction such as 25/2");
    assert_snapshot!(mistakes(read_actions("(:action a :control (?n ?n - number))")), @"domain.pddl:6:25: error: `?n` is declared twice");
    assert_snapshot!(mistakes(read_actions("(:action a :synth-parameters (?n) :control (?n))")), @"domain.pddl:6:44: error: `?n` is declared twice");
    assert_snapshot!(mistakes(read_actions("(:action a :parameters (?n - room) :control (?n))")), @"domain.pddl:6:45: error: `?n` is a parameter already; give each number that the plan chooses a unique name");
    assert_snapshot!(mistakes(read_actions("(:action a :control (?r - room))")), @"domain.pddl:6:27: error: an unknown of type `room`; `:synth-parameters` are numbers");
}
