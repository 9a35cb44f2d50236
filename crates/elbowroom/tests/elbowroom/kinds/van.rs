//! End that must fall into a window of timed initials.

use super::Kind;

/// The van stops at the gate from 20 to 30, and the loading must end while it is there.
pub(crate) const END_IN_A_WINDOW: Kind = Kind {
    name: "an end that must fall into a window of timed initials",
    domain: "(define (domain gate)
  (:requirements :strips :durative-actions :timed-initial-literals)
  (:predicates (van-here) (loaded))
  (:durative-action load :parameters () :duration (= ?duration 8)
    :condition (at end (van-here))
    :effect (at end (loaded))))",
    problem: "(define (problem one-van) (:domain gate)
  (:init (at 20 (van-here)) (at 30 (not (van-here))))
  (:goal (loaded)))",
    plan: "15: (load) [8]\n",
    inside: &["dur_0=[0,29.999]"],
    outside: &["dur_0=[0,30]"],
    dynamic: &["dur_0=[5,14.998]"],
    not_dynamic: &["dur_0=[5,15]"],
};
