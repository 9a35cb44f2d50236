; Robots drive between places, and work there.
(define (domain depot)
  (:requirements :strips :typing :durative-actions)
  (:types robot place)
  (:predicates (at ?robot - robot ?place - place) (free ?place - place))

  (:durative-action move
    :parameters (?robot - robot ?from ?to - place)
    :duration (= ?duration 3)
    :condition (and (at start (at ?robot ?from)) (at start (free ?to)))
    :effect (and (at start (not (at ?robot ?from))) (at start (not (free ?to)))
                 (at end (at ?robot ?to)) (at end (free ?from)))))
