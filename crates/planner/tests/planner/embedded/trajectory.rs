//! Trajectory constraints.

use std::ops::ControlFlow;

use elbowroom_model::validate::{Settings, validate};
use elbowroom_model::{Situation, Task, Verdict};
use elbowroom_planner::{Answer, plan};

use crate::embedded::world::{answer_from, describe, task};

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

fn answer_in_world(task: &Task) -> Answer {
    answer_from(task, &Situation::initial(task), 400)
}

/// Returns the first plan, which the validator has accepted, or the reason why there is none.
fn found(constraints: &str) -> String {
    let task = world(constraints);
    let answer = answer_in_world(&task);
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
fn unconstrained_plan_takes_shortest_path() {
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
fn unsatisfiable_constraint_gives_no_plan() {
    assert_eq!(
        found("(always (not (at a)))"),
        "no plan exists: the constraint (always (not (at a))) is violated from the beginning"
    );
    // Too early to get there.
    assert_eq!(found("(within 3 (seen c))"), "none found: Exhausted");
    assert_eq!(found("(always (not (at c)))"), "none found: Exhausted");
}

#[test]
fn sometime_after_obligation_is_fulfilled_later() {
    let steps = found("(sometime-after (seen c) (at a))");
    assert!(steps.contains("(go b a)"), "{steps}");
    // At b, the obligation is fulfilled.
    let steps = found("(sometime-after (at c) (or (at b) (seen c)))");
    assert!(!steps.contains("(go c b)"), "{steps}");
}

#[test]
fn always_within_response_comes_in_time() {
    // A lamp that is lit on the way to b, and burns only until b is near.
    let steps = found("(and (sometime (lit)) (always-within 3 (lit) (at b)))");
    assert!(
        steps.contains("(go a b)") && steps.contains("(shine)"),
        "{steps}"
    );
    assert!(found("(and (within 3 (lit)) (always-within 3 (lit) (at b)))").contains("(shine)"));
    let late = found("(and (within 0.5 (lit)) (always-within 3 (lit) (at b)))");
    assert!(late.contains("none found"), "{late}");
    // From the beginning on: going to b takes 4.
    assert!(found("(always-within 4 (at a) (at b))").contains("(go a b)"));
    assert!(found("(always-within 3 (at a) (at b))").contains("none found"));
}

#[test]
fn a_condition_holds_during_a_window() {
    for constraint in ["(hold-during 5 9 (at b))", "(hold-during 4 9 (at b))"] {
        let task = world(constraint);
        let answer = answer_in_world(&task);
        let found = answer.found().expect("a plan");
        let leaves = found
            .plan
            .steps
            .iter()
            .find(|step| step.action.name == "(go b c)");
        assert!(
            leaves.expect("it goes on to c").start >= 9.into(),
            "{}",
            describe(&answer)
        );
    }
    assert!(found("(hold-during 3 9 (at b))").contains("none found"));
    // A condition that holds at the end holds for ever.
    assert!(found("(hold-during 1000 1001 (at c))").contains("(go a c)"));
}

#[test]
fn a_condition_holds_from_a_time_on() {
    let steps = found("(hold-after 14 (at a))");
    assert!(steps.contains("(go b a)"), "{steps}");
    assert!(found("(and (hold-after 12 (at a)) (hold-during 0 1 (at a)))").contains("none found"));
}

#[test]
fn a_formula_holds_once_at_most() {
    // Away from a and b, and back.
    let away = "(and (sometime (and (lit) (at b))) (at end (at b))";
    let twice = found(&format!("{away})"));
    assert!(
        twice.contains("(go a c)") || twice.contains("(go b c)"),
        "{twice}"
    );
    let once = found(&format!("{away} (at-most-once (or (at c) (seen c))))"));
    assert!(once.contains("(go c b)"), "{once}");
    let never = found(&format!(
        "{away} (at-most-once (or (at b) (lit))) (sometime (at a)))"
    ));
    assert!(!never.contains("no plan exists"), "{never}");
}

const TANK: &str = "(:predicates (open) (warm) (done ?n - object))
    (:functions (level) (used))
    (:action fill :parameters () :effect (increase (level) 3))
    (:action warm :parameters () :effect (warm))
    (:action take :parameters (?n - object) :precondition (not (done ?n))
      :effect (and (done ?n) (decrease (level) 2)
                   (when (warm) (decrease (level) 1)) (increase (used) 2)))";

fn of_tank(constraints: &str, more: &str) -> String {
    let problem = format!(
        "(:objects one two - object) (:init (= (level) 2) (= (used) 0) {more})
         (:goal (and (done one) (done two))) (:constraints {constraints})"
    );
    let task = task(TANK, &problem);
    describe(&answer_in_world(&task))
}

#[test]
fn a_number_stays_within_bounds() {
    let free = of_tank("(and)", "");
    assert!(!free.contains("(fill)"), "{free}");
    let bounded = of_tank("(always (>= (level) 0))", "");
    assert!(bounded.contains("(fill)"), "{bounded}");
    // Two fillings would exceed 5, before anything is taken.
    let both = of_tank(
        "(and (always (and (>= (level) 0) (<= (level) 5))) (sometime (warm)))",
        "",
    );
    assert!(both.contains("(fill)") && both.contains("(warm)"), "{both}");
    // A single filling of 3 exceeds 4.
    let full = of_tank("(always (and (>= (level) 0) (<= (level) 4)))", "");
    assert!(full.contains("(fill)") && full.contains("(take"), "{full}");
    assert!(of_tank("(always (and (>= (level) 0) (<= (used) 2)))", "").contains("none found"));
    assert!(of_tank("(always (< (level) 2))", "").contains("violated from the beginning"));
}

#[test]
fn constraints_account_for_timed_initials() {
    let timed = "(open) (at 5 (not (open)))";
    assert!(of_tank("(always (open))", timed).contains("is violated at 5"));
    let warm = of_tank("(always (or (open) (warm)))", timed);
    assert!(warm.contains("(warm)"), "{warm}");
    let owed = of_tank("(sometime-after (not (open)) (warm))", timed);
    assert!(owed.contains("(warm)"), "{owed}");
    let soon = of_tank("(always-within 2 (not (open)) (warm))", timed);
    assert!(soon.contains("(warm)"), "{soon}");
    let locked = of_tank("(hold-during 3 7 (or (open) (warm)))", timed);
    assert!(locked.contains("(warm)"), "{locked}");
    let until = of_tank("(hold-during 3 5 (or (open) (warm)))", timed);
    assert!(!until.contains("(warm)"), "{until}");
}

#[test]
fn goal_unreachable_without_constraints_is_proved() {
    let task = task(
        DOMAIN,
        "(:objects a b - room) (:init (at a) (free)) (:goal (seen b))
         (:constraints (always-within 3 (lit) (seen a)))",
    );
    assert!(describe(&answer_in_world(&task)).starts_with("no plan exists"));
}

#[test]
fn constraint_without_regression_is_refused_by_name() {
    let of = |functions: &str, action: &str, constraint: &str| {
        let domain = format!(
            "(:predicates (p) (q) (both) (same)) {functions}
             (:derived (both) (or (same) (and (p) (q)))) (:derived (same) (both))
             (:durative-action a :parameters () :duration (= ?duration 2) :condition (and)
               :effect {action})"
        );
        let problem = format!("(:init (q)) (:goal (p)) (:constraints {constraint})");
        describe(&answer_in_world(&task(&domain, &problem)))
    };
    let derived = of("", "(at end (p))", "(always (not (both)))");
    assert!(derived.contains("on recursive derived facts"), "{derived}");
    let moving = "(and (at end (p)) (increase (x) (* #t 1)))";
    let moving = of("(:functions (x))", moving, "(hold-after 3 (< 2 (x)))");
    assert!(moving.contains("change continuously"), "{moving}");
    let guarded = of(
        "",
        "(and (at end (p)) (when (at start (q)) (at end (not (q)))))",
        "(always (q))",
    );
    assert!(guarded.contains("conditions of other times"), "{guarded}");
}

#[test]
fn derived_facts_in_constraints_are_replaced_by_their_rules() {
    let of = |constraint: &str| {
        let domain = "(:predicates (p) (q) (both) (full)) (:functions (x))
             (:derived (both) (and (p) (q))) (:derived (full) (or (both) (> (x) 3)))
             (:durative-action a :parameters () :duration (= ?duration 2) :condition (and)
               :effect (at end (p)))
             (:durative-action b :parameters () :duration (= ?duration 2) :condition (and)
               :effect (at end (not (q))))
             (:durative-action c :parameters () :duration (= ?duration 2) :condition (and)
               :effect (at end (increase (x) 5)))";
        let problem = format!("(:init (q) (= (x) 0)) (:goal (p)) (:constraints {constraint})");
        describe(&answer_in_world(&task(domain, &problem)))
    };
    let never = of("(always (not (both)))");
    assert!(never.contains("(a)") && never.contains("(b)"), "{never}");
    let never = of("(always (not (full)))");
    assert!(never.contains("(b)") && !never.contains("(c)"), "{never}");
    let before = of("(sometime-before (p) (full))");
    assert!(before.contains("(c)"), "{before}");
}

#[test]
fn constraint_that_only_a_later_start_satisfies_delays_the_plan() {
    let answer = answer_in_world(&task(
        "(:functions (level))
         (:durative-action drain :parameters () :duration (= ?duration 5) :condition (and)
           :effect (decrease (level) (* #t 2)))",
        "(:init (= (level) 4)) (:goal (< (level) 2))
         (:constraints (hold-during 2 7 (>= (level) -2)))",
    ));
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

#[test]
fn constraints_with_running_actions_are_refused() {
    let task = world("(sometime (at b))");
    let later = Situation {
        time: 3.into(),
        ..Situation::initial(&task)
    };
    let answer = describe(&answer_from(&task, &later, 400));
    assert!(answer.contains("during execution"), "{answer}");
}

#[test]
fn profitable_preferences_are_satisfied() {
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
            if progress.counts.evaluated > 60_000 {
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
    // Visiting b on the way to c takes 6 more, which is less than 20. Returning home, or burning
    // the lamp, would cost more than it is worth.
    assert_eq!(violated, ["home", "lamp", "never"]);
}
