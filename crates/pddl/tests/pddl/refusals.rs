//! Features that are parsed but refused, reported by name and position.

use crate::reading::read_actions;
use elbowroom_pddl::{Diagnostics, Feature, is_unsupported};

/// Returns the refused features with their lines. Panics if there is a mistake among them.
fn refused<T: std::fmt::Debug>(read: Result<T, Diagnostics>) -> Vec<(Feature, usize)> {
    let diagnostics = read.expect_err("refused");
    assert!(is_unsupported(&diagnostics), "{diagnostics}");
    diagnostics
        .errors()
        .map(|d| (Feature::of(d).expect("a feature"), d.line()))
        .collect()
}

/// Returns the refused features of a durative action's effect.
fn of_effect(text: &str) -> Vec<(Feature, usize)> {
    refused(read_actions(&format!(
        "(:durative-action a :duration () :effect {text})"
    )))
}

#[test]
fn the_value_of_an_object_fluent_is_refused_where_only_names_can_stand() {
    let domain = elbowroom_pddl::Source::new(
        "domain.pddl",
        "(define (domain d) (:types place robot) (:predicates (clean ?p - place))
           (:functions (fuel ?r - robot) (position ?r - robot) - place)
           (:durative-action sweep :parameters (?r - robot) :duration (= ?duration 1)
              :effect (at end (clean (position ?r)))))",
    );
    let problem = elbowroom_pddl::Source::new(
        "problem.pddl",
        "(define (problem p) (:domain d) (:init) (:goal (and)))",
    );
    let found = refused(elbowroom_pddl::read_problem(&domain, &problem));
    assert_eq!(found, [(Feature::ObjectFluents, 4)]);
}

#[test]
fn change_that_is_not_linear_in_time_is_refused() {
    assert_eq!(
        of_effect("(increase (level) (* #t #t))"),
        [(Feature::NonlinearTime, 6)]
    );
    assert_eq!(
        of_effect("(increase (level) (/ 1 #t))"),
        [(Feature::NonlinearTime, 6)]
    );
}

#[test]
fn a_disjunction_over_several_times_is_refused() {
    let found = refused(read_actions(
        "(:durative-action a :duration () :condition (or (at start (lit)) (at end (lit))))",
    ));
    assert_eq!(found, [(Feature::MixedTimes, 6)]);
}

#[test]
fn strict_bounds_on_a_duration_are_refused() {
    let found = refused(read_actions(
        "(:durative-action a :duration (< ?duration 3))",
    ));
    assert_eq!(found, [(Feature::StrictDurations, 6)]);
}

#[test]
fn error_is_reported_in_addition_to_unsupported_feature() {
    let read = read_actions("(:modules m) (:action a :effect (opne hall))");
    assert!(!is_unsupported(&read.unwrap_err()));
}
