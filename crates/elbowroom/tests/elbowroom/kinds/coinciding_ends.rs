//! Two ends that coincide in the plan, although neither needs the other.

use super::Kind;

/// Two fans need it calm throughout, which it is from the beginning. Each also adds that fact at
/// its end.
pub(crate) const ENDS_THAT_COINCIDE_WITHOUT_NEED: Kind = Kind {
    name: "ends that coincide although neither needs the other",
    domain: "(define (domain fans)
  (:requirements :strips :typing :durative-actions)
  (:types fan)
  (:predicates (calm) (aired ?f - fan))
  (:durative-action air :parameters (?f - fan) :duration (= ?duration 10)
    :condition (over all (calm))
    :effect (and (at end (calm)) (at end (aired ?f)))))",
    problem: "(define (problem two-fans) (:domain fans)
  (:objects left right - fan)
  (:init (calm))
  (:goal (and (aired left) (aired right))))",
    plan: "0: (air left) [10]\n0: (air right) [10]\n",
    inside: &["dur_0=[1,20],dur_1=[3,30]"],
    outside: &[],
    dynamic: &["dur_0=[1,20],dur_1=[3,30]"],
    not_dynamic: &[],
};
