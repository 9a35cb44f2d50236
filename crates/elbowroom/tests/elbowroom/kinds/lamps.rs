//! Condition that holds throughout because of one fact first, and of another one afterwards.

use super::Kind;

/// The second lamp is lit before the first one goes out. Both facts change during the watch, which
/// needs one of them; no other action reads them.
pub(crate) const ONE_FACT_TAKES_OVER: Kind = Kind {
    name: "an over-all condition of which one fact takes over from another",
    domain: "(define (domain lamps)
  (:requirements :typing :durative-actions :disjunctive-preconditions :negative-preconditions)
  (:types lamp)
  (:predicates (on ?l - lamp) (seen))
  (:durative-action watch :parameters (?a ?b - lamp) :duration (= ?duration 20)
    :condition (over all (or (on ?a) (on ?b)))
    :effect (at end (seen)))
  (:durative-action light :parameters (?l - lamp) :duration (= ?duration 5)
    :condition (at start (not (on ?l)))
    :effect (at end (on ?l)))
  (:durative-action dim :parameters (?l - lamp) :duration (= ?duration 7)
    :condition (at start (on ?l))
    :effect (at end (not (on ?l)))))",
    problem: "(define (problem one-watch) (:domain lamps) (:objects a b - lamp) (:init (on a))
  (:goal (and (seen) (on b) (not (on a)))))",
    plan: "0.5: (watch a b) [20]\n1: (light b) [5]\n2: (dim a) [7]\n",
    inside: &["dur_0=[15,30],dur_1=[1,10],dur_2=[1,10]"],
    outside: &[],
    dynamic: &["dur_0=[15,30],dur_1=[1,10],dur_2=[1,10]"],
    not_dynamic: &[],
};
