//! Conjuncts of goals that exclude each other: they are unreachable together, and no proper subset
//! is known to be.

use elbowroom::model::problem::Condition;
use elbowroom::model::{Situation, Task};
use elbowroom::no_plan::{Effort, conflict, no_plan_certificate_within};

use crate::no_plan_claims::task;

/// Returns the conflict of the task, and the conjuncts of its goal with their texts.
fn conflict_of(task: &Task) -> (Vec<String>, Vec<(String, Condition)>) {
    let situation = Situation::initial(task);
    let found = conflict(task, &situation, 10_000_000, &mut || true);
    let parts = match &task.problem().goal {
        Condition::And(parts) => parts.clone(),
        other => vec![other.clone()],
    };
    let in_words = |part: Condition| {
        let ground = task.with_goal(part.clone()).goal().clone();
        (task.describe_condition(&ground), part)
    };
    (found, parts.into_iter().map(in_words).collect())
}

fn is_impossible(task: &Task, parts: &[&Condition]) -> bool {
    let goal = Condition::And(parts.iter().map(|part| (*part).clone()).collect());
    let (task, mut may_continue) = (task.with_goal(goal), || true);
    let mut effort = Effort::of(10_000_000, &mut may_continue);
    no_plan_certificate_within(&task, &Situation::initial(&task), &mut effort).is_ok()
}

/// A token moves between places. Any two of the three goals can be reached.
const TOKENS: &str = "(:requirements :negative-preconditions) (:predicates (a) (b) (c) (lamp))
    (:action ab :parameters () :precondition (and (a) (not (b))) :effect (and (not (a)) (b)))
    (:action bc :parameters () :precondition (and (b) (not (c))) :effect (and (not (b)) (c)))
    (:action ca :parameters () :precondition (and (c) (not (a))) :effect (and (not (c)) (a)))
    (:action light :parameters () :precondition () :effect (lamp))";

#[test]
fn conflict_is_out_of_reach_and_minimal() {
    let cases = [
        ("(a) (b)", "(and (a) (b) (c) (lamp))", "(a) (b) (c)"),
        ("(a)", "(and (lamp) (b) (c))", "(b) (c)"),
        ("(a)", "(and (a) (lamp) (b) (c))", "(b) (c)"),
        ("(a) (b)", "(and (a) (b) (lamp))", ""),
        ("", "(and (a) (lamp))", ""),
        ("(a)", "(b)", ""),
    ];
    for (init, goal, expected) in cases {
        let task = task(TOKENS, init, goal);
        let (found, parts) = conflict_of(&task);
        assert_eq!(found.join(" "), expected, "{init}: {goal}");
        let members = parts.iter().filter(|(words, _)| found.contains(words));
        let members: Vec<&Condition> = members.map(|(_, part)| part).collect();
        assert_eq!(is_impossible(&task, &members), !found.is_empty(), "{goal}");
        for left_out in 0..members.len() {
            let mut fewer = members.clone();
            fewer.remove(left_out);
            assert!(!is_impossible(&task, &fewer), "{goal} without {left_out}");
        }
    }
}

#[test]
fn conflict_is_empty_without_work_or_when_interrupted() {
    let task = task(TOKENS, "(a) (b)", "(and (a) (b) (c))");
    let situation = Situation::initial(&task);
    assert!(conflict(&task, &situation, 1, &mut || true).is_empty());
    assert!(conflict(&task, &situation, 10_000_000, &mut || false).is_empty());
}
