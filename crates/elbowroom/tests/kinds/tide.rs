//! Timed initials that change what nothing reads, or change it as it should be.

use super::Kind;

const DOMAIN: &str = "(define (domain harbour)
  (:requirements :strips :negative-preconditions :durative-actions :fluents
                 :timed-initial-literals)
  (:predicates (ebb) (fog) (unloaded))
  (:functions (depth))
  (:durative-action unload :parameters () :duration (= ?duration 10)
    :condition () :effect (at end (unloaded)))
  (:durative-action sail :parameters () :duration (= ?duration 10)
    :condition (at start (ebb)) :effect (at end (not (unloaded)))))";

/// The tide would matter to who sails, and nobody does.
pub(crate) const CHANGES_THAT_NOTHING_READS: Kind = Kind {
    name: "deadlines that nothing reads",
    domain: DOMAIN,
    problem: "(define (problem stay) (:domain harbour)
  (:init (ebb) (= (depth) 4) (at 30 (not (ebb))) (at 40 (ebb)) (at 30 (= (depth) 2)))
  (:goal (unloaded)))",
    plan: "0: (unload) [10]\n",
    inside: &["dur_0=[0,100]"],
    outside: &[],
    dynamic: &["dur_0=[0,100]"],
    not_dynamic: &[],
};

/// It is clear, becomes clear once more, and only then foggy: that the sky clears limits nothing.
pub(crate) const CHANGES_THAT_SERVE_THE_GOAL: Kind = Kind {
    name: "a timed initial that makes the goal's fact what it is",
    domain: DOMAIN,
    problem: "(define (problem clear) (:domain harbour)
  (:init (at 30 (not (fog))) (at 50 (fog)))
  (:goal (and (unloaded) (not (fog)))))",
    plan: "0: (unload) [10]\n",
    inside: &["dur_0=[0,49.999]"],
    outside: &["dur_0=[0,50]"],
    dynamic: &["dur_0=[0,49.999]"],
    not_dynamic: &[],
};
