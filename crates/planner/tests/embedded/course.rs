//! Constraints on the course of a plan.

use std::ops::ControlFlow;

use elbowroom_model::validate::{Settings, validate};
use elbowroom_model::{Situation, Task, Verdict};
use elbowroom_planner::{Answer, plan};

use crate::world::{answer_from, describe, task};

/// A robot among three rooms that visits them, and a lamp that burns while it is held.
const DOMAIN: &str = "(:types room)
    (:predicates (at ?r - room) (seen ?r - room) (linked ?a ?b - room) (lit) (free))
    (:durative-action go :parameters (?a ?b - room) :duration (= ?duration 4)
      :condition (and (at start (at ?a)) (at start (linked ?a ?b)))
      :effect (and (at start (not (at ?a))) (at end (at ?b))))
    (:durative-action look :parameters (?r - room) :duration (= ?duration 1)
      :condition (and (over all (at ?r)) (at start (free)))
      :effect (and (at start (not (free))) (at end (free)) (at end (seen ?r))))
    (:durative-action shine :parameters () :duration (= ?duration 6)
      :condition (at start (free))
      :effect (and (at start (not (free))) (at start (lit))
                   (at end (free)) (at end (not (lit)))))";

fn world(constraints: &str) -> Task {
    task(
        DOMAIN,
        &format!(
            "(:objects a b c - room)
             (:init (at a) (free) (linked a b) (linked b a) (linked b c) (linked c b) (linked a c))
             (:goal (seen c)) (:constraints {constraints})"
        ),
    )
}

fn answered(task: &Task) -> Answer {
    answer_from(task, &Situation::initial(task), 400)
}

/// The first plan, which the judge has accepted, or why there is none.
fn found(constraints: &str) -> String {
    let task = world(constraints);
    let answer = answered(&task);
    if let Some(found) = answer.found() {
        let verdict = validate(&task, &found.plan, &Settings::default());
        assert!(matches!(verdict, Verdict::Valid(_)), "{verdict:?}");
        let steps = &found.plan.steps;
        assert!(
            steps
                .iter()
                .all(|step| !step.action.name.contains("look 3"))
        );
    }
    describe(&answer)
}

#[test]
fn without_a_reason_the_plan_goes_the_shortest_way() {
    let steps = found("(and)");
    assert!(
        steps.contains("(go a c)") && !steps.contains("(go a b)"),
        "{steps}"
    );
}

#[test]
fn each_constraint_changes_the_plan() {
    for (constraint, expected) in [
        ("(sometime (at b))", "(go a b)"),
        ("(sometime (and (at b) (lit)))", "(shine)"),
        ("(at end (at a))", "(go b a)"),
        ("(sometime-before (at c) (seen b))", "(look b)"),
        ("(always (imply (at c) (or (seen a) (seen b))))", "(look a)"),
        ("(and (within 2 (seen a)) (within 11 (seen c)))", "(look a)"),
        (
            "(and (at-most-once (at b)) (sometime (at b)) (at end (at c)))",
            "(go b c)",
        ),
        (
            "(forall (?r - room) (sometime-before (seen c) (or (seen ?r) (lit))))",
            "(shine)",
        ),
    ] {
        let steps = found(constraint);
        assert!(steps.contains(expected), "{constraint}\n{steps}");
    }
}

#[test]
fn what_no_plan_can_keep_is_not_kept() {
    assert_eq!(
        found("(always (not (at a)))"),
        "no plan exists: the constraint (always (not (at a))) is broken from the beginning"
    );
    // In no time to get there.
    assert_eq!(found("(within 3 (seen c))"), "none found: Exhausted");
    assert_eq!(found("(always (not (at c)))"), "none found: Exhausted");
}

#[test]
fn the_other_constraints_are_refused_by_name() {
    for constraint in [
        "(sometime-after (at c) (at a))",
        "(always-within 3 (lit) (seen c))",
        "(hold-during 1 2 (at a))",
        "(hold-after 1 (free))",
    ] {
        assert!(
            found(constraint).contains("does not handle"),
            "{constraint}"
        );
    }
    assert!(found("(at-most-once (or (at a) (at b)))").contains("does not handle"));
}

#[test]
fn a_plan_under_way_is_refused() {
    let task = world("(sometime (at b))");
    let later = Situation {
        time: 3.into(),
        ..Situation::initial(&task)
    };
    let answer = describe(&answer_from(&task, &later, 400));
    assert!(answer.contains("in mid-execution"), "{answer}");
}

#[test]
fn preferences_that_pay_are_kept() {
    let task = task(
        DOMAIN,
        "(:objects a b c - room)
         (:init (at a) (free) (linked a b) (linked b a) (linked b c) (linked c b) (linked a c))
         (:goal (and (seen c) (preference home (at a)) (preference all (seen b))))
         (:constraints (and (preference dark (always (not (lit))))
                            (preference never (always (not (at c))))
                            (preference lamp (sometime (lit)))))
         (:metric minimize (+ (total-time) (+ (* 20 (is-violated all))
            (+ (* 100 (is-violated never)) (+ (* 3 (is-violated home)) (is-violated lamp))))))",
    );
    let mut values = Vec::new();
    let answer = plan(
        &task,
        &Situation::initial(&task),
        &elbowroom_planner::Settings::default(),
        &mut |progress| {
            values.extend(progress.plan.as_ref().map(|found| found.value.clone()));
            if progress.counts.evaluated > 30_000 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    );
    assert!(values.len() > 1 && values.windows(2).all(|two| two[1] <= two[0]));
    let found = answer.found().expect("a plan");
    let Verdict::Valid(report) = validate(&task, &found.plan, &Settings::default()) else {
        panic!("{found:?}")
    };
    let names = &task.problem().preferences;
    let violated = report.preferences.violated.iter();
    let mut violated: Vec<_> = violated
        .map(|one| names[one.preference.index()].as_str())
        .collect();
    violated.sort_unstable();
    // To see b, on the way to c, takes 6 more, which is less than 20. To be home again, or to burn
    // the lamp, would take more than it is worth.
    assert_eq!(violated, ["home", "lamp", "never"]);
}
