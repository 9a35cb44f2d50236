//! Deadlines for two independent ends.

use super::Kind;

/// Each letter has its own last collection. A late letter does not affect the other.
pub(crate) const TWO_DEADLINES: Kind = Kind {
    name: "two ends with a deadline each",
    domain: "(define (domain letters)
  (:requirements :strips :typing :durative-actions :timed-initial-literals)
  (:types letter)
  (:predicates (box-open ?l - letter) (sent ?l - letter))
  (:durative-action write-and-post :parameters (?l - letter) :duration (= ?duration 10)
    :condition (at end (box-open ?l))
    :effect (at end (sent ?l))))",
    problem: "(define (problem two-letters) (:domain letters)
  (:objects bill card - letter)
  (:init (box-open bill) (box-open card)
         (at 20 (not (box-open bill))) (at 40 (not (box-open card))))
  (:goal (and (sent bill) (sent card))))",
    plan: "0: (write-and-post bill) [10]\n0: (write-and-post card) [10]\n",
    inside: &["dur_0=[0,19.999],dur_1=[0,39.999]"],
    outside: &["dur_0=[0,20]", "dur_1=[0,40]"],
    dynamic: &["dur_0=[0,19.999],dur_1=[0,39.999]"],
    not_dynamic: &[],
};
