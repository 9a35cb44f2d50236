//! Over-all condition that is achieved by an action starting at the same moment.

use super::Kind;

/// The printer needs the power of the generator, which is started together with it.
pub(crate) const CONDITION_FROM_AN_ACTION_THAT_STARTS_TOGETHER: Kind = Kind {
    name: "an over-all condition from an action that starts together",
    domain: "(define (domain print-room)
  (:requirements :strips :durative-actions)
  (:predicates (power) (printed))
  (:durative-action run-generator :parameters () :duration (= ?duration 20)
    :condition ()
    :effect (and (at start (power)) (at end (not (power)))))
  (:durative-action print :parameters () :duration (= ?duration 10)
    :condition (over all (power))
    :effect (at end (printed))))",
    problem: "(define (problem one-job) (:domain print-room) (:init) (:goal (printed)))",
    plan: "0: (run-generator) [20]\n0: (print) [10]\n",
    inside: &["dur_0=[0,12],dur_1=[12,30]"],
    outside: &["dur_0=[0,12],dur_1=[11.999,30]"],
    dynamic: &["dur_0=[5,12],dur_1=[12,30]"],
    not_dynamic: &[],
};
