//! Durative actions of duration 0.

use super::Kind;

/// Stamping is a durative action with duration 0.
pub(crate) const NO_TIME_AT_ALL: Kind = Kind {
    name: "actions of duration 0",
    domain: "(define (domain office)
  (:requirements :strips :durative-actions)
  (:predicates (form) (stamped) (posted) (logged))
  (:durative-action stamp :parameters () :duration (= ?duration 0)
    :condition (and (at start (form)) (over all (form)))
    :effect (at end (stamped)))
  (:durative-action log :parameters () :duration (= ?duration 0)
    :condition () :effect (at start (logged)))
  (:durative-action post :parameters () :duration (= ?duration 5)
    :condition (and (at start (stamped)) (at end (logged)))
    :effect (at end (posted))))",
    problem: "(define (problem one-form) (:domain office) (:init (form)) (:goal (posted)))",
    plan: "0: (stamp) [0]\n0: (log) [0]\n0.001: (post) [5]\n",
    inside: &["dur_0=[0,7],dur_1=[0,4],dur_2=[0.001,9]"],
    outside: &[],
    dynamic: &["dur_0=[0,7],dur_1=[0,4],dur_2=[1,9]"],
    not_dynamic: &[],
};
