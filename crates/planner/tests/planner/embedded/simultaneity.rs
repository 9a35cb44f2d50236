//! Over-all conditions at the moments of start and end: effects of the start itself, joint effects
//! of several happenings of one moment, durations of 0, and open ends.

use elbowroom_planner::Answer;

use crate::embedded::world::{answer, answer_with_self_overlap, describe};

fn with_requirements(domain: &str) -> String {
    format!(
        "(:requirements :typing :adl :durative-actions :numeric-fluents :duration-inequalities
          :continuous-effects :derived-predicates :timed-initial-literals) {domain}"
    )
}

fn assert_plan_found(domain: &str, problem: &str) {
    let answer = answer(&with_requirements(domain), problem);
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

/// Checks one action whose over-all condition is false before its start.
fn assert_plan_found_with(predicates: &str, over_all: &str, start_effect: &str, init: &str) {
    assert_plan_found(
        &format!(
            "(:types thing) (:constants a b - thing) (:predicates (done) {predicates})
             (:durative-action work :parameters () :duration (= ?duration 3)
               :condition (over all {over_all})
               :effect (and {start_effect} (at end (done))))"
        ),
        &format!("(:init {init}) (:goal (done))"),
    );
}

#[test]
fn conditional_start_effect_makes_own_over_all_condition_true() {
    let effect = "(when (at start (key)) (at start (open)))";
    assert_plan_found_with("(key) (open)", "(open)", effect, "(key)");
}

#[test]
fn quantified_start_effect_makes_own_over_all_condition_true() {
    let effect = "(forall (?x - thing) (when (at start (key ?x)) (at start (open ?x))))";
    assert_plan_found_with(
        "(key ?x - thing) (open ?x - thing)",
        "(open b)",
        effect,
        "(key b)",
    );
}

#[test]
fn conditional_deletion_makes_own_over_all_condition_true() {
    let effect = "(when (at start (key)) (at start (not (shut))))";
    assert_plan_found_with("(key) (shut)", "(not (shut))", effect, "(key) (shut)");
}

#[test]
fn derived_fact_follows_from_own_start() {
    let rules = "(:derived (lit) (lamp))";
    for (over_all, effect, init) in [
        ("(lit)", "(at start (lamp))", ""),
        ("(not (lit))", "(at start (not (lamp)))", "(lamp)"),
    ] {
        assert_plan_found(
            &format!(
                "(:predicates (lamp) (lit) (done)) {rules}
                 (:durative-action work :parameters () :duration (= ?duration 3)
                   :condition (over all {over_all}) :effect (and {effect} (at end (done))))"
            ),
            &format!("(:init {init}) (:goal (done))"),
        );
    }
}

#[test]
fn own_start_makes_disjunctive_over_all_condition_true() {
    assert_plan_found_with("(p) (q)", "(or (p) (q))", "(at start (q))", "");
}

#[test]
fn timed_change_of_a_rule_does_not_end_an_action_whose_derived_condition_stays_true() {
    assert_plan_found(
        "(:predicates (one) (other) (lit) (done)) (:derived (lit) (or (one) (other)))
         (:durative-action work :parameters () :duration (= ?duration 9)
           :condition (over all (lit)) :effect (at end (done)))",
        "(:init (one) (other) (at 1 (not (one))) (at 2 (one)) (at 3 (not (other)))) (:goal (done))",
    );
}

#[test]
fn simultaneous_instances_satisfy_numeric_over_all_condition() {
    let domain = with_requirements(
        "(:predicates (done)) (:functions (n))
         (:durative-action lift :parameters () :duration (= ?duration 2)
           :condition (over all (>= (n) 2))
           :effect (and (at start (increase (n) 1)) (at end (done))))",
    );
    let answer = answer_with_self_overlap(&domain, "(:init (= (n) 0)) (:goal (done))");
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

#[test]
fn simultaneous_starts_can_support_each_other() {
    assert_plan_found(
        "(:predicates (p) (q) (done) (ready))
         (:durative-action one :parameters () :duration (= ?duration 2)
           :condition (over all (q)) :effect (and (at start (p)) (at end (done))))
         (:durative-action other :parameters () :duration (= ?duration 2)
           :condition (over all (p)) :effect (and (at start (q)) (at end (ready))))",
        "(:init) (:goal (and (done) (ready)))",
    );
}

#[test]
fn over_all_condition_is_vacuous_for_duration_zero() {
    for duration in [
        "(= ?duration 0)",
        "(<= ?duration 4)",
        "(= ?duration (length))",
    ] {
        assert_plan_found(
            &format!(
                "(:predicates (p) (done)) (:functions (length))
                 (:durative-action blink :parameters () :duration {duration}
                   :condition (over all (p)) :effect (at end (done)))"
            ),
            "(:init (= (length) 0)) (:goal (done))",
        );
    }
}

#[test]
fn duration_zero_needs_start_and_end_that_do_not_interfere() {
    let answer = answer(
        "(:requirements :durative-actions) (:predicates (p) (q))
         (:durative-action blink :parameters () :duration (= ?duration 0)
           :condition (over all (q)) :effect (and (at start (not (p))) (at end (p))))",
        "(:init) (:goal (p))",
    );
    assert!(answer.found().is_none(), "{}", describe(&answer));
}

/// Returns the answer for a tank that an action drains or fills by 20 each unit of time, under a
/// strict over-all condition.
fn tank(duration: u8, condition: &str, change: &str, level: u8) -> Answer {
    answer(
        &format!(
            "(:requirements :durative-actions :numeric-fluents :continuous-effects)
             (:predicates (ok)) (:functions (level))
             (:durative-action act :parameters () :duration (= ?duration {duration})
               :condition (over all {condition})
               :effect (and ({change} (level) (* #t 20)) (at end (ok))))"
        ),
        &format!("(:init (= (level) {level})) (:goal (ok))"),
    )
}

#[test]
fn strict_bound_may_be_met_at_an_open_end() {
    for (duration, condition, change, level) in [
        (5, "(> (level) 0)", "decrease", 100),
        (5, "(< (level) 100)", "decrease", 100),
        (5, "(< (level) 100)", "increase", 0),
        (5, "(> (level) 0)", "increase", 0),
    ] {
        let answer = tank(duration, condition, change, level);
        assert!(
            answer.found().is_some(),
            "{condition} {change}: {}",
            describe(&answer)
        );
    }
}

#[test]
fn strict_bound_must_not_be_met_inside() {
    let answer = tank(6, "(> (level) 0)", "decrease", 100);
    assert!(answer.found().is_none(), "{}", describe(&answer));
}

#[test]
fn self_interference_separates_start_and_end_if_duration_may_be_zero() {
    assert_plan_found(
        "(:predicates (p) (done)) (:functions (n) (m))
         (:durative-action work :parameters () :duration (<= ?duration 1)
           :condition (at start (not (p)))
           :effect (and (increase (n) (* #t 1)) (at end (p))))",
        "(:init (= (n) 0) (= (m) 0)) (:goal (and (p) (> (n) 0)))",
    );
}

#[test]
fn product_of_a_chosen_duration_and_a_number_is_found() {
    assert_plan_found(
        "(:functions (n))
         (:durative-action grow :parameters ()
           :duration (and (>= ?duration 2) (<= ?duration 4))
           :effect (at end (scale-up (n) ?duration)))",
        "(:init (= (n) 1)) (:goal (>= (n) 3))",
    );
}

#[test]
fn derived_fact_reads_a_number_that_changes_continuously() {
    assert_plan_found(
        "(:predicates (full) (done)) (:functions (n)) (:derived (full) (>= (n) 3))
         (:durative-action fill :parameters () :duration (<= ?duration 9)
           :effect (increase (n) (* #t 1)))
         (:action stop :parameters () :precondition (full) :effect (done))",
        "(:init (= (n) 0)) (:goal (done))",
    );
}

#[test]
fn goal_that_needs_two_overlapping_continuous_changes_is_found() {
    assert_plan_found(
        "(:types thing) (:constants a b - thing)
         (:functions (n))
         (:durative-action fill :parameters (?x - thing)
           :duration (and (>= ?duration 3) (<= ?duration 5))
           :effect (and (at start (assign (n) 0)) (increase (n) (* #t 1))))",
        "(:init (= (n) 1)) (:goal (> (n) 6))",
    );
}

#[test]
fn timed_value_that_breaks_the_goal_is_repaired_afterwards() {
    assert_plan_found(
        "(:functions (n) (m))
         (:durative-action reset :parameters () :duration (= ?duration 1)
           :effect (at end (decrease (n) (n))))
         (:durative-action drain :parameters () :duration (= ?duration 10)
           :effect (and (decrease (n) (* #t 2)) (decrease (m) (* #t 3))))
         (:durative-action grow :parameters () :duration (= ?duration 2)
           :condition (at end (>= (m) 9)) :effect (increase (n) (* #t 5)))",
        "(:init (= (n) 6) (= (m) 0) (at 2 (= (n) -1))) (:goal (>= (n) 0))",
    );
}

#[test]
fn noncommuting_simultaneous_updates_are_excluded() {
    assert_plan_found(
        "(:predicates (p)) (:functions (n))
         (:action both :parameters () :effect (and (assign (n) 5) (increase (n) 1) (p)))
         (:action plain :parameters () :effect (and (increase (n) 1) (p)))",
        "(:init (= (n) 0)) (:goal (p))",
    );
}
