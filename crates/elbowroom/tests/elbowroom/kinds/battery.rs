//! Jobs that drain one battery, which has more charge than they take.

use super::Kind;

const DOMAIN: &str = "(define (domain workshop)
  (:requirements :strips :typing :durative-actions :fluents :continuous-effects)
  (:types job)
  (:predicates (done ?j - job))
  (:functions (charge))
  (:durative-action work :parameters (?j - job) :duration (= ?duration 10)
    :condition (over all (>= (charge) 0))
    :effect (and (decrease (charge) (* #t 1)) (at end (done ?j)))))";

const PROBLEM: &str = "(define (problem three-jobs) (:domain workshop)
  (:objects drill grind saw - job)
  (:init (= (charge) 39))
  (:goal (and (done drill) (done grind) (done saw))))";

/// Simultaneous starts: the jobs need not end together.
pub(crate) const THREE_JOBS_AT_ONCE: Kind = Kind {
    name: "three jobs draining one battery at once",
    domain: DOMAIN,
    problem: PROBLEM,
    plan: "0: (work saw) [10]\n0: (work drill) [10]\n0: (work grind) [10]\n",
    inside: &[
        "dur_0=[10,12],dur_1=[9,10],dur_2=[10,11]",
        "dur_0=[0,13],dur_1=[0,13],dur_2=[0,13]",
        "dur_0=[0,19]",
    ],
    outside: &[
        "dur_0=[0,13],dur_1=[0,13],dur_2=[0,13.001]",
        "dur_0=[0,19.001]",
    ],
    dynamic: &["dur_0=[5,13],dur_1=[5,13],dur_2=[5,13]"],
    not_dynamic: &[],
};

/// Successive starts, with overlaps: the job that starts first need not end first.
pub(crate) const THREE_JOBS_IN_TURN: Kind = Kind {
    name: "three jobs draining one battery, overlapping",
    domain: DOMAIN,
    problem: PROBLEM,
    plan: "0: (work saw) [10]\n1: (work drill) [10]\n2: (work grind) [10]\n",
    inside: &[
        "dur_0=[10,12],dur_1=[9,10],dur_2=[10,11]",
        "dur_0=[0,13],dur_1=[0,13],dur_2=[0,13]",
    ],
    outside: &["dur_0=[0,13],dur_1=[0,13],dur_2=[0,13.001]"],
    dynamic: &["dur_0=[5,13],dur_1=[5,13],dur_2=[5,13]"],
    not_dynamic: &[],
};
