//! Numbers that are used up, lent out, and filled up again.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Settings, Technique, plan};

use crate::world::{
    answer, answer_with_self_overlap, answer_without_cleanup, describe, makespan, task,
};

/// A hand-truck pair is lent out for a while; moving the piano takes two of them at once.
#[test]
fn what_is_lent_in_numbers_is_no_proof_that_it_is_missing() {
    let domain = "
        (:requirements :durative-actions :numeric-fluents)
        (:predicates (moved) (piano)) (:functions (stock) (lent))
        (:durative-action lend :parameters () :duration (= ?duration 9)
          :condition (at start (>= (stock) 1))
          :effect (and (at start (decrease (stock) 1)) (at start (increase (lent) 1))
                       (at end (decrease (lent) 1)) (at end (increase (stock) 1))))
        (:durative-action move :parameters () :duration (= ?duration 4)
          :condition (and (at start (piano)) (at start (>= (lent) 2)) (at end (>= (lent) 1)))
          :effect (at end (moved)))";
    let problem =
        |stock: u32| format!("(:init (piano) (= (stock) {stock}) (= (lent) 0)) (:goal (moved))");
    let together = answer_with_self_overlap(domain, &problem(2));
    assert_eq!(makespan(&together), "9001/1000");
    let alone = answer(domain, &problem(1));
    assert!(alone.found().is_none(), "{}", describe(&alone));
}

/// A rover on a road of places in a row, with a battery for so many steps; it is charged, by one
/// step each time, at the beginning only. A sample lies at each end.
fn road(length: usize, capacity: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :numeric-fluents)
        (:types place) (:predicates (at ?p - place) (next ?p ?q - place) (plug ?p - place)
          (sample ?p - place) (taken ?p - place) (idle))
        (:functions (battery) (capacity))
        (:durative-action drive :parameters (?p ?q - place) :duration (= ?duration 2)
          :condition (and (at start (at ?p)) (at start (next ?p ?q)) (at start (>= (battery) 1)))
          :effect (and (at start (not (at ?p))) (at end (at ?q)) (at start (decrease (battery) 1))))
        (:durative-action charge :parameters (?p - place) :duration (= ?duration 3)
          :condition (and (over all (at ?p)) (at start (plug ?p)) (at start (idle))
            (at start (< (battery) (capacity))))
          :effect (and (at start (not (idle))) (at end (idle)) (at end (increase (battery) 1))))
        (:durative-action take :parameters (?p - place) :duration (= ?duration 1)
          :condition (and (over all (at ?p)) (at start (sample ?p)))
          :effect (and (at start (not (sample ?p))) (at end (taken ?p))))";
    let names: Vec<String> = (0..=2 * length).map(|n| format!("p{n}")).collect();
    let ways: String = names
        .windows(2)
        .map(|two| format!("(next {0} {1})(next {1} {0})", two[0], two[1]))
        .collect();
    let (first, middle, last) = (&names[0], &names[length], &names[2 * length]);
    let problem = format!(
        "(:objects {} - place) (:init (at {middle}) (idle) (plug {middle}) {ways}
          (sample {first}) (sample {last}) (= (battery) 1) (= (capacity) {capacity}))
         (:goal (and (taken {first}) (taken {last})))",
        names.join(" "),
    );
    (domain.to_owned(), problem)
}

#[test]
fn what_a_relaxed_plan_uses_up_is_filled_up_before() {
    let (domain, problem) = road(6, 12);
    let answer = answer_without_cleanup(&domain, &problem);
    let Answer::Plan { counts, .. } = &answer else {
        panic!("{}", describe(&answer));
    };
    // Nothing else tells the rover to charge before it is stranded: without counting what is used
    // up, this takes ten times as many states.
    assert!(counts.evaluated < 150, "{} states", counts.evaluated);
}

/// The battery drains while the rover drives, and is charged for as long as it takes. Its actions exclude each
/// other.
#[test]
fn continuous_drain_is_filled_up_before() {
    let (domain, problem) = road(8, 20);
    let domain = domain
        .replace(
            "(at start (at ?p)) (at start (next",
            "(at start (idle)) (at start (at ?p)) (at start (next",
        )
        .replace("(at start (>= (battery) 1))", "(over all (>= (battery) 0))")
        .replace(
            "(at start (decrease (battery) 1))",
            "(at start (not (idle))) (at end (idle)) (decrease (battery) (* #t 0.5))",
        )
        .replace(
            ":duration (= ?duration 3)",
            ":duration (and (>= ?duration 1) (<= ?duration 30))",
        )
        .replace(
            "(at start (< (battery) (capacity)))",
            "(over all (<= (battery) (capacity)))",
        )
        .replace(
            "(at end (increase (battery) 1))",
            "(increase (battery) (* #t 1))",
        );
    let count = |without: &[Technique]| {
        let task = task(&domain, &problem);
        let mut settings = Settings {
            first_plan_only: true,
            ..Settings::default()
        };
        settings.tuning.without.push(Technique::Cleanup);
        settings.tuning.without.extend(without);
        let situation = Situation::initial(&task);
        let answer = plan(&task, &situation, &settings, &mut |_| {
            ControlFlow::Continue(())
        });
        let Answer::Plan { counts, .. } = &answer else {
            panic!("{}", describe(&answer));
        };
        counts.evaluated
    };
    let (with, without) = (count(&[]), count(&[Technique::ContinuousDrains]));
    assert!(4 * with < without, "{with} states, {without} without");
}

#[test]
fn a_battery_that_is_too_small_is_no_plan() {
    let (domain, problem) = road(4, 7);
    let answer = answer(&domain, &problem);
    assert!(
        matches!(answer, Answer::Unsolvable { .. }),
        "{}",
        describe(&answer)
    );
}
