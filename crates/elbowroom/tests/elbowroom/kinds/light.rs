//! Two simultaneous ends: until then, one needs the fact that the other deletes.

use super::Kind;

/// A fuse is mended by a match that goes out at the same moment.
pub(crate) const ENDS_AT_THE_SAME_INSTANT: Kind = Kind {
    name: "an over-all condition that is spoiled at the very end",
    domain: "(define (domain cellar)
  (:requirements :strips :durative-actions)
  (:predicates (unused) (light) (mended))
  (:durative-action burn :parameters () :duration (= ?duration 10)
    :condition (at start (unused))
    :effect (and (at start (not (unused))) (at start (light)) (at end (not (light)))))
  (:durative-action mend :parameters () :duration (= ?duration 10)
    :condition (over all (light))
    :effect (at end (mended))))",
    problem: "(define (problem one-fuse) (:domain cellar) (:init (unused)) (:goal (mended)))",
    plan: "0: (burn) [10]\n0: (mend) [10]\n",
    inside: &["dur_0=[10,12],dur_1=[0,10]"],
    outside: &["dur_0=[9.999,12],dur_1=[0,10]"],
    dynamic: &["dur_0=[10,12],dur_1=[5,10]"],
    not_dynamic: &[],
};
