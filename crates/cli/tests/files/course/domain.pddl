(define (domain rounds)
  (:requirements :durative-actions :typing :constraints :preferences)
  (:types place)
  (:predicates (at ?p - place) (seen ?p - place))
  (:durative-action go
    :parameters (?from ?to - place)
    :duration (= ?duration 5)
    :condition (and (at start (at ?from)) (preference thorough (at start (seen ?from))))
    :effect (and (at start (not (at ?from))) (at end (at ?to))))
  (:durative-action look
    :parameters (?p - place)
    :duration (= ?duration 2)
    :condition (over all (at ?p))
    :effect (at end (seen ?p))))
