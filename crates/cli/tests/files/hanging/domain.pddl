; Two robots, each of which can put a parcel into the van.
(define (domain loading)
  (:requirements :typing :durative-actions)
  (:types robot parcel)
  (:predicates (waiting ?p - parcel) (loaded ?p - parcel))
  (:durative-action load :parameters (?r - robot ?p - parcel) :duration (= ?duration 2)
    :condition (at start (waiting ?p))
    :effect (and (at end (loaded ?p)) (at end (not (waiting ?p))))))
