//! Strict over-all comparison that becomes an equality exactly at the end.

use super::Kind;

/// The tank must not be full during the filling, and is full at its end.
pub(crate) const COMPARISON_THAT_ENDS_IN_AN_EQUALITY: Kind = Kind {
    name: "a strict comparison that becomes an equality at the end",
    domain: "(define (domain cistern)
  (:requirements :strips :durative-actions :fluents :continuous-effects)
  (:predicates (filled))
  (:functions (level))
  (:durative-action fill :parameters () :duration (= ?duration 10)
    :condition (over all (< (level) 20))
    :effect (and (increase (level) (* #t 2)) (at end (filled)))))",
    problem: "(define (problem one-cistern) (:domain cistern)
  (:init (= (level) 0)) (:goal (and (filled) (>= (level) 4))))",
    plan: "0: (fill) [10]\n",
    inside: &["dur_0=[2,10]"],
    outside: &["dur_0=[2,10.001]", "dur_0=[1.999,10]"],
    dynamic: &["dur_0=[2,10]"],
    not_dynamic: &[],
};
