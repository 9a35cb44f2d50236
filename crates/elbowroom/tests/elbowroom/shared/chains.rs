//! Plans with many parameters: robots that go from place to place.

use std::fmt::Write as _;

/// Resource that a robot needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Needs {
    /// Only time.
    Time,
    /// Charge that decreases during each way, and must never be below zero.
    Charge,
}

/// Returns a domain, a problem and a plan in which each robot goes `ways` ways of 10 time units
/// each. The doors close after one and a half times the planned duration.
pub(crate) fn chains(robots: usize, ways: usize, needs: Needs) -> (String, String, String) {
    let is_charged = needs == Needs::Charge;
    let (functions, condition, effect) = if is_charged {
        (
            "(:functions (charge ?r - robot))",
            "(over all (>= (charge ?r) 0))",
            "(decrease (charge ?r) (* #t 1))",
        )
    } else {
        ("", "", "")
    };
    let domain = format!(
        "(define (domain chains) (:requirements :typing :durative-actions :fluents :timed-initial-literals)
           (:types place robot)
           (:predicates (at ?r - robot ?p - place) (next ?p ?q - place) (open)) {functions}
           (:durative-action go :parameters (?r - robot ?p ?q - place) :duration (= ?duration 10)
             :condition (and (at start (at ?r ?p)) (at start (next ?p ?q)) (over all (open)) {condition})
             :effect (and (at start (not (at ?r ?p))) (at end (at ?r ?q)) {effect})))"
    );
    let (mut objects, mut init, mut goal) = (String::new(), String::new(), String::new());
    for place in 0..=ways {
        write!(objects, "p{place} ").expect("memory");
    }
    objects.push_str("- place ");
    for place in 0..ways {
        write!(init, "(next p{place} p{}) ", place + 1).expect("memory");
    }
    for robot in 0..robots {
        write!(objects, "r{robot} ").expect("memory");
        write!(init, "(at r{robot} p0) ").expect("memory");
        if is_charged {
            write!(init, "(= (charge r{robot}) {}) ", 13 * ways).expect("memory");
        }
        write!(goal, "(at r{robot} p{ways}) ").expect("memory");
    }
    let problem = format!(
        "(define (problem chains) (:domain chains) (:objects {objects}- robot)
           (:init (open) {init} (at {} (not (open)))) (:goal (and {goal})))",
        15 * ways
    );
    let mut plan = String::new();
    for way in 0..ways {
        // In thousandths, like ε.
        let start = 10_001 * way;
        for robot in 0..robots {
            writeln!(
                plan,
                "{}.{:03}: (go r{robot} p{way} p{}) [10]",
                start / 1000,
                start % 1000,
                way + 1
            )
            .expect("memory");
        }
    }
    (domain, problem, plan)
}
