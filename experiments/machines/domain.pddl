; Paper 2's SF3, after its description, with durations that matter.

(define (domain machines)
  (:requirements :strips :typing :durative-actions)

  (:types machine)

  (:predicates (maintained ?m - machine) (working ?m - machine))

  (:durative-action maintain
    :parameters (?m - machine)
    :duration (= ?duration 10)
    :condition (and (at start (working ?m)) (over all (working ?m)) (at end (working ?m)))
    :effect (at end (maintained ?m))))
