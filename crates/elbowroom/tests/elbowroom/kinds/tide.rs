//! Timed initials that change facts without a reader, or facts of the goal.

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

/// The tide would affect sailing, but no ship sails.
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

/// The fog lifts long after the ship is unloaded, and no action has to wait for that.
pub(crate) const GOAL_THAT_COMES_BY_ITSELF: Kind = Kind {
    name: "a goal that a timed initial brings about in the end",
    domain: DOMAIN,
    problem: "(define (problem clear) (:domain harbour)
  (:init (fog) (at 30 (fog)) (at 50 (not (fog))))
  (:goal (and (unloaded) (not (fog)))))",
    plan: "0: (unload) [10]\n",
    inside: &["dur_0=[0,100]"],
    outside: &[],
    dynamic: &["dur_0=[0,100]"],
    not_dynamic: &[],
};

/// The shop opens at 10 and closes at 28, and the lamps go out at 30. Lamps that are lit before
/// then do not count, so lighting one takes more than 2.
pub(crate) const GOAL_THAT_IS_TAKEN_AWAY: Kind = Kind {
    name: "a timed initial that takes the goal away from who is too early",
    domain: "(define (domain lamps)
  (:requirements :strips :durative-actions :timed-initial-literals)
  (:predicates (open) (lit))
  (:durative-action light :parameters () :duration (= ?duration 10)
    :condition (at start (open)) :effect (at end (lit))))",
    problem: "(define (problem evening) (:domain lamps)
  (:init (at 10 (open)) (at 28 (not (open))) (at 30 (not (lit))))
  (:goal (lit)))",
    plan: "25: (light) [10]\n",
    inside: &["dur_0=[2.002,100]"],
    outside: &["dur_0=[2,10]"],
    dynamic: &["dur_0=[2.002,100]"],
    not_dynamic: &[],
};
