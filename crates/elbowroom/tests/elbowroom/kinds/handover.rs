//! Hand-over: one action must begin and end within another.

use super::Kind;

/// One robot holds out a part until the other one has taken it.
pub(crate) const END_WITHIN_ANOTHER: Kind = Kind {
    name: "an action that must end within another",
    domain: "(define (domain hand-over)
  (:requirements :strips :durative-actions)
  (:predicates (offered) (taken) (given))
  (:durative-action give :parameters () :duration (= ?duration 6)
    :condition (at end (taken))
    :effect (and (at start (offered)) (at end (not (offered))) (at end (given))))
  (:durative-action take :parameters () :duration (= ?duration 2)
    :condition (and (at start (offered)) (over all (offered)) (at end (offered)))
    :effect (at end (taken))))",
    problem: "(define (problem one-part) (:domain hand-over) (:init) (:goal (given)))",
    plan: "0: (give) [6]\n3: (take) [2]\n",
    inside: &["dur_0=[5.5,7],dur_1=[0,5.498]"],
    outside: &["dur_0=[5.5,7],dur_1=[0,5.499]"],
    dynamic: &["dur_0=[5.5,7],dur_1=[1,5.498]"],
    not_dynamic: &[],
};
