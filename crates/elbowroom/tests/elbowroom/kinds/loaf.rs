//! End that needs a fact which another action provides only while it runs.

use super::Kind;

/// The oven must be watched when the loaf is done, and cannot be watched for long.
pub(crate) const END_WHILE_ANOTHER_RUNS: Kind = Kind {
    name: "an end that needs what another action holds while it runs",
    domain: "(define (domain bakery)
  (:requirements :strips :durative-actions)
  (:predicates (watched) (done))
  (:durative-action bake :parameters () :duration (= ?duration 30)
    :condition (at end (watched))
    :effect (at end (done)))
  (:durative-action watch :parameters () :duration (= ?duration 6)
    :condition ()
    :effect (and (at start (watched)) (at end (not (watched))))))",
    problem: "(define (problem loaf) (:domain bakery) (:init) (:goal (done)))",
    plan: "0: (bake) [30]\n27: (watch) [6]\n",
    inside: &["dur_0=[0,100],dur_1=[0.002,6]"],
    outside: &["dur_1=[0.001,6]"],
    dynamic: &["dur_0=[28,32],dur_1=[5,7]", "dur_0=[25,29.998],dur_1=[5,7]"],
    not_dynamic: &["dur_0=[25,29.999],dur_1=[5,7]"],
};
