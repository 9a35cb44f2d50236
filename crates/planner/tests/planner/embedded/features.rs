//! Each feature as a small problem.

use crate::embedded::world::{answer, describe, makespan, task};
use elbowroom_model::validate::{Settings, validate};
use elbowroom_pddl::{Source, read_plan};
use elbowroom_planner::Answer;

const MATCH: &str = "
    (:requirements :typing :durative-actions)
    (:types fuse)
    (:predicates (unused) (light) (hand) (mended ?f - fuse))
    (:durative-action strike :parameters () :duration (= ?duration 5)
      :condition (at start (unused))
      :effect (and (at start (not (unused))) (at start (light)) (at end (not (light)))))
    (:durative-action mend :parameters (?f - fuse) :duration (= ?duration 2)
      :condition (and (at start (hand)) (over all (light)))
      :effect (and (at start (not (hand))) (at end (mended ?f)) (at end (hand))))";

#[test]
fn a_match_gives_light_while_it_burns() {
    let problem = "(:objects a b - fuse) (:init (unused) (hand))
                   (:goal (and (mended a) (mended b)))";
    assert_eq!(makespan(&answer(MATCH, problem)), "5");
}

#[test]
fn three_fuses_do_not_fit_under_one_match() {
    let problem = "(:objects a b c - fuse) (:init (unused) (hand))
                   (:goal (and (mended a) (mended b) (mended c)))";
    assert!(matches!(answer(MATCH, problem), Answer::Unsolvable { .. }));
}

/// The second instance starts later, takes less, and ends with the first: at one time, both delete
/// the fact that both need until then. The search does not find this plan, and must not claim that
/// none exists.
#[test]
fn instances_that_start_apart_and_end_together_are_found() {
    let domain = "
        (:requirements :durative-actions :fluents)
        (:predicates (power) (coin) (first) (second)) (:functions (left))
        (:durative-action run :parameters () :duration (= ?duration (left))
          :condition (over all (power)) :effect (and (at start (coin)) (at end (not (power)))))
        (:action wait :parameters () :precondition (and) :effect (assign (left) 5))
        (:action pay-first :parameters () :precondition (coin) :effect (and (not (coin)) (first)))
        (:action pay-second :parameters () :precondition (and (coin) (first))
          :effect (and (not (coin)) (second)))";
    let problem = "(:init (power) (= (left) 10)) (:goal (second))";
    let task = task(domain, problem);
    let text = "0: (run) [10]\n1: (pay-first)\n2: (wait)\n5: (run) [5]\n6: (pay-second)";
    let (plan, _) = read_plan(&Source::new("plan", text), &task).unwrap();
    assert!(validate(&task, &plan, &Settings::default()).is_valid());
    let answer = answer(domain, problem);
    assert!(
        !matches!(answer, Answer::Unsolvable { .. }),
        "{}",
        describe(&answer)
    );
}

const DOOR: &str = "
    (:requirements :typing :durative-actions :timed-initial-literals)
    (:predicates (open) (in))
    (:durative-action enter :parameters () :duration (= ?duration 10)
      :condition (over all (open)) :effect (at end (in)))";

#[test]
fn action_waits_for_window_to_open() {
    let problem = "(:init (at 7 (open)) (at 17 (not (open)))) (:goal (in))";
    assert_eq!(describe(&answer(DOOR, problem)), "7: (enter) [10]");
}

#[test]
fn too_short_window_is_a_proof_with_reason() {
    let problem = "(:init (open) (at 9.5 (not (open)))) (:goal (in))";
    assert_eq!(
        describe(&answer(DOOR, problem)),
        "no plan exists: `(in)` cannot be reached before `(open)` closes at 9.5"
    );
}

#[test]
fn the_goal_counts_after_all_timed_initials() {
    let plan = |problem: &str| describe(&answer(DOOR, problem));
    // No action is needed for facts that timed initials add.
    let closing = "(:init (open) (at 17 (not (open)))) (:goal (and (in) (not (open))))";
    assert_eq!(plan(closing), "0: (enter) [10]");
    assert_eq!(plan("(:init (at 7 (open))) (:goal (open))"), "");
    // Facts that a timed initial deletes have to be achieved later, or not at all.
    let turned_out = "(:init (open) (at 20 (not (in)))) (:goal (in))";
    assert_eq!(plan(turned_out), "10001/1000: (enter) [10]");
    let closed = "(:init (open) (at 17 (not (open)))) (:goal (and (in) (open)))";
    assert_eq!(
        plan(closed),
        "no plan exists: `(open)` is false from 17 on in every plan"
    );
    let too_early = "(:init (open) (at 17 (not (open))) (at 20 (not (in)))) (:goal (in))";
    assert!(
        plan(too_early).starts_with("no plan exists without self-overlap"),
        "{}",
        plan(too_early)
    );
}

/// Neither the lamp nor its hours matter to the goal. Without them, only one action and one window
/// remain to be tried, and an exhausted search proves that the second item has no time.
#[test]
fn irrelevant_actions_and_timed_initials_are_removed() {
    let domain = "
        (:requirements :typing :durative-actions :timed-initial-literals)
        (:types item)
        (:predicates (open) (hand) (in ?i - item) (day) (lamp))
        (:durative-action enter :parameters (?i - item) :duration (= ?duration 10)
          :condition (and (at start (hand)) (over all (open)))
          :effect (and (at start (not (hand))) (at end (hand)) (at end (in ?i))))
        (:durative-action light :parameters () :duration (= ?duration 1)
          :condition (and (at start (not (lamp))) (over all (day))) :effect (at end (lamp)))
        (:durative-action dim :parameters () :duration (= ?duration 1)
          :condition (and (at start (lamp)) (over all (day))) :effect (at end (not (lamp))))";
    let hours: String = (0..10)
        .map(|n| format!("(at {} (day)) (at {} (not (day)))", 10 * n + 3, 10 * n + 8))
        .collect();
    let problem = |close: u32| {
        format!(
            "(:objects a b - item)
             (:init (hand) (at 7 (open)) (at {close} (not (open))) {hours})
             (:goal (and (in a) (in b)))"
        )
    };
    let found = answer(domain, &problem(28));
    assert!(found.found().is_some(), "{}", describe(&found));
    let counts = found.counts().unwrap();
    assert_eq!(counts.actions, 2);
    let none = answer(domain, &problem(27));
    assert!(
        describe(&none).starts_with("no plan exists"),
        "{}",
        describe(&none)
    );
    let evaluated = none.counts().unwrap().evaluated;
    assert!(evaluated < 40, "{evaluated} states");
}

#[test]
fn unachievable_goal_is_named() {
    let problem = "(:init) (:goal (in))";
    assert_eq!(
        describe(&answer(DOOR, problem)),
        "no plan exists: `(in)` cannot become true"
    );
}

const TANK: &str = "
    (:requirements :typing :durative-actions :numeric-fluents :duration-inequalities)
    (:predicates (busy) (done))
    (:functions (level))
    (:durative-action fill :parameters ()
      :duration (and (>= ?duration 1) (<= ?duration 10))
      :condition (at start (not (busy)))
      :effect (and (at start (busy)) (at end (not (busy)))
                   (at end (increase (level) (* 3 ?duration)))))
    (:durative-action use :parameters () :duration (= ?duration 1)
      :condition (at start (and (not (busy)) (>= (level) 20)))
      :effect (and (at start (decrease (level) 20)) (at end (done))))";

#[test]
fn duration_is_chosen_long_enough_for_dependent_effect() {
    let answer = answer(TANK, "(:init (= (level) 0)) (:goal (done))");
    let found = answer.found().expect("a plan");
    let fill = &found.plan.steps[0];
    assert_eq!(fill.action.name, "(fill)");
    let needed = "20/3".parse().expect("as written above");
    assert!(fill.duration.as_ref().is_some_and(|d| *d >= needed));
}

#[test]
fn continuous_effect_is_read_while_active() {
    let domain = "
        (:requirements :typing :durative-actions :numeric-fluents :continuous-effects)
        (:predicates (idle) (hot))
        (:functions (temperature))
        (:durative-action heat :parameters () :duration (= ?duration 30)
          :condition (at start (idle))
          :effect (and (at start (not (idle))) (at end (idle))
                       (increase (temperature) (* #t 2))))
        (:action look :parameters ()
          :precondition (and (>= (temperature) 30) (<= (temperature) 40)) :effect (hot))";
    let answer = answer(domain, "(:init (idle) (= (temperature) 0)) (:goal (hot))");
    let found = answer.found().expect("a plan");
    let look = found.plan.steps.iter().find(|s| s.action.name == "(look)");
    let time = &look.expect("it looks").start;
    assert!(
        *time >= 15.into() && *time <= 20.into(),
        "{}",
        describe(&answer)
    );
}

#[test]
fn actions_that_consume_a_stock_run_concurrently() {
    let domain = "
        (:requirements :typing :durative-actions :numeric-fluents)
        (:types part) (:predicates (made ?p - part) (raw ?p - part))
        (:functions (stock))
        (:durative-action make :parameters (?p - part) :duration (= ?duration 10)
          :condition (and (at start (raw ?p)) (over all (>= (stock) 0)))
          :effect (and (at start (not (raw ?p))) (at end (made ?p))
                       (at end (decrease (stock) 2))))";
    let problem = "(:objects a b c - part) (:init (raw a) (raw b) (raw c) (= (stock) 6))
                   (:goal (and (made a) (made b) (made c)))";
    assert_eq!(makespan(&answer(domain, problem)), "10");
}

/// A courier carries a parcel to a counter. Handing it over ends the carrying, which is its
/// over-all condition.
const COUNTER: &str = "
    (:requirements :typing :durative-actions :timed-initial-literals)
    (:types place) (:predicates (at ?p - place) (open ?p - place) (parcel ?p - place)
      (carrying) (delivered))
    (:durative-action go :parameters (?a ?b - place) :duration (= ?duration 10)
      :condition (at start (at ?a)) :effect (and (at start (not (at ?a))) (at end (at ?b))))
    (:durative-action take :parameters (?p - place) :duration (= ?duration 5)
      :condition (and (over all (at ?p)) (at start (parcel ?p)))
      :effect (and (at start (not (parcel ?p))) (at end (carrying))))
    (:durative-action hand-over :parameters (?p - place) :duration (= ?duration 1)
      :condition (and (over all (at ?p)) (over all (carrying)) (over all (open ?p)))
      :effect (and (at end (not (carrying))) (at end (delivered))))";

#[test]
fn deadline_proof_includes_way_to_and_from_parcel() {
    let problem = "(:objects home shelf counter - place)
        (:init (at home) (parcel shelf) (open counter) (at 25.9 (not (open counter))))
        (:goal (delivered))";
    // The place, the carrying, and the open counter are each possible in time separately.
    assert_eq!(
        describe(&answer(COUNTER, problem)),
        "no plan exists: `(delivered)` cannot be reached before `(open counter)` closes at 25.9"
    );
    let later = problem.replace("25.9", "26.1");
    assert_eq!(makespan(&answer(COUNTER, &later)), "26");
}

const LAMPS: &str = "
    (:requirements :adl :typing)
    (:types lamp)
    (:predicates (on ?l - lamp) (broken ?l - lamp) (seen) (known))
    (:action switch :parameters (?l - lamp) :precondition (not (on ?l))
      :effect (when (not (broken ?l)) (on ?l)))
    (:action see :parameters ()
      :precondition (or (exists (?l - lamp) (on ?l)) (known)) :effect (seen))
    (:action mend :parameters (?l - lamp) :precondition (broken ?l) :effect (not (broken ?l)))";

#[test]
fn disjunctions_quantifiers_and_conditional_effects() {
    let problem = "(:objects a b - lamp) (:init (broken a) (broken b))
                   (:goal (and (seen) (forall (?l - lamp) (imply (broken ?l) (not (on ?l))))))";
    let answer = answer(LAMPS, problem);
    assert_eq!(answer.found().expect("a plan").plan.steps.len(), 3);
}

#[test]
fn derived_facts_are_supported() {
    let domain = "
        (:requirements :adl :derived-predicates :typing)
        (:types place)
        (:predicates (link ?a ?b - place) (joined ?a ?b - place) (here ?a - place))
        (:derived (joined ?a ?b - place)
          (or (link ?a ?b) (exists (?c - place) (and (link ?a ?c) (joined ?c ?b)))))
        (:action join :parameters (?a ?b - place) :precondition (not (link ?a ?b))
          :effect (link ?a ?b))
        (:action jump :parameters (?a ?b - place)
          :precondition (and (here ?a) (joined ?a ?b))
          :effect (and (not (here ?a)) (here ?b)))";
    let problem = "(:objects a b c - place) (:init (here a) (link b c)) (:goal (here c))";
    assert!(answer(domain, problem).found().is_some());
}

#[test]
fn battery_and_charger() {
    let domain = "
        (:requirements :durative-actions :numeric-fluents)
        (:predicates (idle) (home) (away) (sent))
        (:functions (battery))
        (:durative-action charge :parameters () :duration (= ?duration 4)
          :condition (and (at start (idle)) (over all (home)) (at start (<= (battery) 3)))
          :effect (and (at start (not (idle))) (at end (idle)) (at end (increase (battery) 7))))
        (:durative-action go :parameters () :duration (= ?duration 3)
          :condition (and (at start (idle)) (at start (home)) (at start (>= (battery) 6)))
          :effect (and (at start (not (idle))) (at start (not (home))) (at end (idle))
                       (at start (decrease (battery) 6)) (at end (away))))";
    let answer = answer(
        domain,
        "(:init (idle) (home) (= (battery) 2)) (:goal (away))",
    );
    assert_eq!(describe(&answer), "0: (charge) [4]\n4001/1000: (go) [3]");
}

#[test]
fn unsupported_feature_is_named() {
    let domain = "
        (:requirements :adl :durative-actions)
        (:predicates (p) (q) (r))
        (:durative-action a :parameters () :duration (= ?duration 1) :condition ()
          :effect (when (over all (p)) (at end (q))))
        (:action b :parameters () :precondition (p) :effect (not (p)))";
    let said = describe(&answer(domain, "(:init (p)) (:goal (q))"));
    assert!(
        said.contains("over the whole action") && said.contains("(a)"),
        "{said}"
    );
}

#[test]
fn interchangeable_objects_are_tried_once() {
    let names = (0..24)
        .map(|n| format!("f{n}"))
        .collect::<Vec<_>>()
        .join(" ");
    let domain = "
        (:requirements :typing :durative-actions)
        (:types fuse) (:predicates (hand) (mended ?f - fuse) (spare ?f - fuse) (lit))
        (:durative-action mend :parameters (?f - fuse) :duration (= ?duration 2)
          :condition (and (at start (hand)) (at start (spare ?f)))
          :effect (and (at start (not (hand))) (at start (not (spare ?f)))
                       (at end (mended ?f)) (at end (hand))))
        (:action light :parameters (?f - fuse) :precondition (and (mended ?f) (lit)) :effect (lit))";
    let spares = (0..24)
        .map(|n| format!("(spare f{n})"))
        .collect::<Vec<_>>()
        .join(" ");
    let problem = format!(
        "(:objects {names} - fuse) (:init (hand) {spares}) (:goal (and (mended f0) (mended f9) (hand)))"
    );
    assert!(answer(domain, &problem).found().is_some());
}

#[test]
fn impossible_conditional_effect_keeps_fact_readable() {
    // (p) never changes, but the validator separates its readers from the actions that may change
    // it.
    let plan = describe(&answer(
        "(:predicates (p) (q) (g) (seen) (open))
         (:durative-action a :parameters () :duration (= ?duration 2) :condition (at start (and))
           :effect (and (when (at start (q)) (at start (p))) (at end (g))))
         (:action look :parameters () :precondition (and (p) (open)) :effect (seen))",
        "(:init (p) (open) (at 0.5 (not (open)))) (:goal (and (g) (seen)))",
    ));
    assert!(plan.contains("(look)"), "{plan}");
}
