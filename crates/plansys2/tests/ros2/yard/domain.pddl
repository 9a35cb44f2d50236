; Robots drive between places of a yard, and one of them signals.
(define (domain yard)
  (:requirements :strips :typing :durative-actions :numeric-fluents)
  (:types robot place)
  (:predicates (at ?r - robot ?p - place) (signalled ?p - place))
  (:functions (trips ?r - robot))
  (:durative-action move
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration 2)
    :condition (at start (at ?r ?from))
    :effect (and (at start (not (at ?r ?from))) (at end (at ?r ?to)) (at end (increase (trips ?r) 1))))
  (:durative-action signal
    :parameters (?r - robot ?p - place)
    :duration (= ?duration 1)
    :condition (over all (at ?r ?p))
    :effect (at end (signalled ?p))))
