//! Sets of actions for recovery after the failure of a plan.

use elbowroom::execute::{ActionSets, Embedded};
use elbowroom::mdp::{Settings, optimum, supported};
use elbowroom_sim::WorldModel;

use super::task;

/// A casting weighs 6 as planned, and can be sold from 5 on. A casting that is too light is melted
/// down, and there is time for another one with the second mould, which never fails. A mould can be
/// used once.
const DOMAIN: &str = "
(define (domain foundry)
  (:requirements :strips :fluents :durative-actions :timed-initial-literals)
  (:predicates (free) (first-mould) (cast) (second) (open) (sold))
  (:functions (weight))
  (:durative-action cast-first :parameters () :duration (= ?duration 10)
    :condition (and (at start (free)) (at start (first-mould)) (over all (open)))
    :effect (and (at start (not (free))) (at start (not (first-mould))) (at end (cast)) (at end (increase (weight) 6))))
  (:durative-action sell-first :parameters () :duration (= ?duration 2)
    :condition (and (at start (cast)) (at start (>= (weight) 5)) (over all (open)))
    :effect (at end (sold)))
  (:durative-action melt :parameters () :duration (= ?duration 3)
    :condition (and (at start (cast)) (over all (open)))
    :effect (and (at start (not (cast))) (at end (free)) (at end (assign (weight) 0))))
  (:durative-action cast-second :parameters () :duration (= ?duration 30)
    :condition (and (at start (free)) (over all (open)))
    :effect (and (at start (not (free))) (at end (second))))
  (:durative-action sell-second :parameters () :duration (= ?duration 2)
    :condition (and (at start (second)) (over all (open)))
    :effect (at end (sold))))";

const PROBLEM: &str = "
(define (problem one) (:domain foundry)
  (:init (free) (first-mould) (open) (= (weight) 0) (at 50 (not (open))))
  (:goal (sold)))";

const WORLD: &str = r#"
format = "elbowroom-world"
version = 1

[[amount]]
action = "cast-first"
fluent = "weight"
normal = { mean = 6, deviation = 1, minimum = 0 }
"#;

fn named(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| format!("({name})")).collect()
}

#[test]
fn set_is_completed_with_supporting_actions_only() {
    let task = task(DOMAIN, PROBLEM);
    let world = WorldModel::read(WORLD, task.problem()).expect("it is a world");
    let with = |actions: &[&str], others: &[&str]| {
        supported(&task, &world, &named(actions), &named(others)).expect("it can be tabulated")
    };
    let before = ["sell-first", "cast-first"];
    assert_eq!(
        with(&["melt", "sell-second"], &before),
        named(&["melt", "sell-second", "cast-first"])
    );
    // An action that is applicable by itself needs nothing, and neither does one whose conditions
    // no other action achieves.
    assert_eq!(
        with(&["cast-second", "sell-second"], &before),
        named(&["cast-second", "sell-second"])
    );
    assert_eq!(with(&["sell-second"], &before), named(&["sell-second"]));
}

/// The planner's plan casts once, and succeeds in five of six cases. The recovery in the other
/// cases is not a plan from the beginning.
#[test]
fn fallback_sets_are_found_in_samples() {
    let task = task(DOMAIN, PROBLEM);
    let world = WorldModel::read(WORLD, task.problem()).expect("it is a world");
    let sets = ActionSets::new(&task, &world, Embedded::default(), &|| true);
    let mut later = named(&["cast-first", "cast-second", "melt", "sell-second"]);
    later.sort_unstable();
    assert!(sets.fallbacks.contains(&later), "{sets:?}");
    // If all actions are few, the recovery is found among them as well. A policy restricted to the
    // plan is worse.
    let settings = Settings {
        plans: vec![named(&["cast-first", "sell-first"])],
        ..Settings::default()
    };
    let found = optimum(&task, &world, &settings, &|| true).expect("it can be tabulated");
    assert!(found.lower > 0.99, "{found:?}");
    let only = Settings {
        only: Some(named(&["cast-first", "sell-first"])),
        ..settings
    };
    let found = optimum(&task, &world, &only, &|| true).expect("it can be tabulated");
    assert!(found.upper < 0.9, "{found:?}");
}
