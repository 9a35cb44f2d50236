//! An end that needs another end and has a deadline.

use super::Kind;

/// The finishing must end after the casting, and before the kiln is closed at 20.
pub(crate) const END_AFTER_AN_END_BEFORE_A_DEADLINE: Kind = Kind {
    name: "an end that needs another end and has a deadline",
    domain: "(define (domain foundry)
  (:requirements :strips :durative-actions :timed-initial-literals)
  (:predicates (cast-ready) (kiln-open) (finished))
  (:durative-action cast :parameters () :duration (= ?duration 12)
    :condition () :effect (at end (cast-ready)))
  (:durative-action finish :parameters () :duration (= ?duration 5)
    :condition (and (at end (cast-ready)) (at end (kiln-open)))
    :effect (at end (finished))))",
    problem: "(define (problem one-bell) (:domain foundry)
  (:init (kiln-open) (at 20 (not (kiln-open))))
  (:goal (finished)))",
    plan: "0: (cast) [12]\n9: (finish) [5]\n",
    inside: &["dur_0=[0,19.998],dur_1=[0,19.999]"],
    outside: &["dur_0=[0,19.999]"],
    dynamic: &["dur_0=[10,13],dur_1=[4,10.998]"],
    not_dynamic: &["dur_0=[10,13],dur_1=[4,10.999]"],
};
