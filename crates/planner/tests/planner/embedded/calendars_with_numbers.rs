//! Calendars in problems whose numbers depend on times, and numeric calendars.

use elbowroom_model::validate::{Settings as Strictness, Verdict};
use elbowroom_model::{Situation, validate_from};
use elbowroom_planner::Answer;
use proptest::prelude::*;

use crate::embedded::world::{answer, answer_from, describe, makespan, task};

/// Robots water beds in a greenhouse. The battery is charged for an open time, and each bed may be
/// watered in its own windows only.
const GREENHOUSE: &str = "
    (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals
        :duration-inequalities)
    (:types robot place)
    (:predicates (at ?r - robot ?p - place) (idle ?r - robot) (shaded ?p - place)
        (watered ?p - place) (dock ?p - place) (closed))
    (:functions (battery ?r - robot) (metres ?a ?b - place))
    (:durative-action drive :parameters (?r - robot ?a ?b - place)
      :duration (= ?duration (metres ?a ?b))
      :condition (and (at start (at ?r ?a)) (at start (idle ?r)) (over all (not (closed)))
        (at start (>= (battery ?r) (metres ?a ?b))))
      :effect (and (at start (not (at ?r ?a))) (at start (not (idle ?r)))
        (at end (at ?r ?b)) (at end (idle ?r))
        (at end (decrease (battery ?r) (metres ?a ?b)))))
    (:durative-action water :parameters (?r - robot ?p - place) :duration (= ?duration 5)
      :condition (and (over all (at ?r ?p)) (over all (shaded ?p)) (at start (idle ?r)))
      :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (watered ?p))))
    (:durative-action charge :parameters (?r - robot ?p - place)
      :duration (and (>= ?duration 1) (<= ?duration 50))
      :condition (and (over all (at ?r ?p)) (over all (dock ?p)) (at start (idle ?r))
        (over all (<= (battery ?r) 40)))
      :effect (and (at start (not (idle ?r))) (at end (idle ?r))
        (increase (battery ?r) (* #t 1))))";

/// Returns a problem with a dock and some beds at distance 6 of each other, with windows of these
/// lengths that recur after 40.
fn greenhouse(beds: usize, robots: usize, begins: &[i64], length: i64, rounds: i64) -> String {
    let names: Vec<String> = (0..beds).map(|bed| format!("b{bed}")).collect();
    let places: Vec<String> = names.iter().cloned().chain(["d".to_owned()]).collect();
    let mut init = "(dock d)".to_owned();
    for from in &places {
        for to in places.iter().filter(|to| *to != from) {
            init += &format!(" (= (metres {from} {to}) 6)");
        }
    }
    let robots: Vec<String> = (0..robots).map(|robot| format!("r{robot}")).collect();
    for robot in &robots {
        init += &format!(" (at {robot} d) (idle {robot}) (= (battery {robot}) 3)");
    }
    for (bed, begin) in names.iter().zip(begins) {
        for round in 0..rounds {
            let begin = begin + 40 * round;
            let end = begin + length;
            init += &format!(" (at {begin} (shaded {bed})) (at {end} (not (shaded {bed})))");
        }
    }
    for round in 0..rounds {
        let begin = 37 + 40 * round;
        init += &format!(" (at {begin} (closed)) (at {} (not (closed)))", begin + 2);
    }
    let goal: String = names
        .iter()
        .map(|bed| format!(" (watered {bed})"))
        .collect();
    let (robots, places) = (robots.join(" "), places.join(" "));
    format!(
        "(:objects {robots} - robot {places} - place) (:init {init}) (:goal (and{goal} (at r0 d)))"
    )
}

#[test]
fn robots_that_charge_for_open_times_wait_for_recurring_windows() {
    let begins = [5, 17, 29, 11, 23, 8];
    let answer = answer(GREENHOUSE, &greenhouse(6, 2, &begins, 9, 12));
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

#[test]
fn long_charge_moves_work_to_a_later_window() {
    // The first window is over after the charge of 9 that two drives need, and 5 of work.
    let answer = answer(GREENHOUSE, &greenhouse(1, 1, &[7], 7, 3));
    // Charge to 12, drive there, wait for the window at 47, and drive back.
    assert_eq!(makespan(&answer), "58001/1000", "{}", describe(&answer));
}

/// Boats pass a bar between harbours only while the water is deep enough.
const TIDES: &str = "(:requirements :typing :durative-actions :numeric-fluents
        :timed-initial-literals)
    (:types boat harbour)
    (:predicates (at ?b - boat ?h - harbour) (unloaded ?b - boat))
    (:functions (depth ?h - harbour) (draught ?b - boat))
    (:durative-action sail :parameters (?b - boat ?x ?y - harbour) :duration (= ?duration 10)
      :condition (and (at start (at ?b ?x)) (at start (>= (depth ?x) (draught ?b)))
        (at end (>= (depth ?y) (draught ?b))))
      :effect (and (at start (not (at ?b ?x))) (at end (at ?b ?y))))
    (:durative-action unload :parameters (?b - boat ?h - harbour) :duration (= ?duration 6)
      :condition (and (over all (at ?b ?h)) (over all (>= (depth ?h) (draught ?b))))
      :effect (at end (unloaded ?b)))";

#[test]
fn numeric_calendar_restricts_starts_and_ends() {
    let init = "(:objects b - boat x y - harbour) (:init (at b x) (= (draught b) 3)
        (= (depth x) 2) (= (depth y) 4) (at 5 (= (depth x) 3)) (at 10 (= (depth x) 1))
        (at 14 (= (depth y) 2)) (at 18 (= (depth y) 5)) (at 23 (= (depth y) 1))
        (at 40 (= (depth y) 3)) (at 43 (= (depth y) 4)))";
    let sailed = answer(TIDES, &format!("{init} (:goal (at b y))"));
    // The water at x is deep enough from 5 to 10, and at y after 18.
    assert_eq!(makespan(&sailed), "18001/1000", "{}", describe(&sailed));
    let unloaded = answer(TIDES, &format!("{init} (:goal (unloaded b))"));
    // The water at x is not deep enough for long, nor at y before 40.
    assert_eq!(makespan(&unloaded), "46", "{}", describe(&unloaded));
}

#[test]
fn water_that_never_is_deep_enough_is_no_plan() {
    let init = "(:objects b - boat x y - harbour) (:init (at b x) (= (draught b) 3)
        (= (depth x) 2) (= (depth y) 4) (at 5 (= (depth x) 3)) (at 7 (= (depth x) 1))
        (at 8 (= (depth y) 2)))";
    let answer = answer(TIDES, &format!("{init} (:goal (at b y))"));
    assert!(answer.found().is_none(), "{}", describe(&answer));
}

/// A telescope needs good seeing, which only timed initials change, or a heater.
const TELESCOPE: &str = "(:requirements :durative-actions :numeric-fluents
        :timed-initial-literals)
    (:predicates (seen) (warm)) (:functions (seeing))
    (:durative-action look :parameters () :duration (= ?duration 6)
      :condition (over all (<= (seeing) 2)) :effect (at end (seen)))";

#[test]
fn goal_on_a_timed_fluent_that_is_never_reached_is_denied_at_once() {
    let init = "(:init (= (seeing) 1) (at 10 (= (seeing) 4)) (at 20 (= (seeing) 3)))";
    let heater = "(:durative-action heat :parameters () :duration (= ?duration 6)
      :condition () :effect (at end (increase (seeing) 6)))";
    let with_goal =
        |domain: &str, goal: &str| answer(domain, &format!("{init} (:goal (and (seen) {goal}))"));
    for goal in ["(>= (seeing) 9)", "(= (seeing) 4)"] {
        let answer = with_goal(TELESCOPE, goal);
        let Answer::Unsolvable { proof, counts } = &answer else {
            panic!("{}", describe(&answer));
        };
        assert_eq!(counts.evaluated, 0);
        let why = format!("`{goal}` is false after all timed initials in every plan");
        assert_eq!(proof.to_string(), format!("no plan exists: {why}"));
    }
    for (domain, goal) in [
        (TELESCOPE.to_owned(), "(= (seeing) 3)"),
        (format!("{TELESCOPE}{heater}"), "(>= (seeing) 9)"),
    ] {
        let answer = with_goal(&domain, goal);
        assert!(answer.found().is_some(), "{}", describe(&answer));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn recurring_windows_that_are_long_enough_have_a_plan(
        begins in prop::collection::vec(1..30_i64, 1..4),
        length in 7..10_i64,
        robots in 1..3_usize,
    ) {
        let beds = begins.len();
        let rounds = 4 + 2 * i64::try_from(beds).unwrap();
        let task = task(GREENHOUSE, &greenhouse(beds, robots, &begins, length, rounds));
        let situation = Situation::initial(&task);
        let answer = answer_from(&task, &situation, 400);
        let found = answer.found();
        prop_assert!(found.is_some(), "{}", describe(&answer));
        let plan = &found.unwrap().plan;
        let verdict = validate_from(&task, &situation, plan, &Strictness::default());
        prop_assert!(matches!(verdict, Verdict::Valid(_)), "{}", describe(&answer));
    }
}
