; A camera films a chick as it hatches. The shot must begin while the egg is whole, and go on until
; the chick is out: the end of the brooding falls inside the shot, and nobody knows beforehand when
; that will be.

(define (domain hatchery)
  (:requirements :strips :negative-preconditions :durative-actions :fluents)

  (:predicates (warm) (hatched) (filmed))

  (:functions (brooding-time) (shot-length))

  (:durative-action brood
    :parameters ()
    :duration (= ?duration (brooding-time))
    :condition (at start (not (warm)))
    :effect (and (at start (warm)) (at end (hatched))))

  (:durative-action film
    :parameters ()
    :duration (= ?duration (shot-length))
    :condition (and (at start (not (hatched))) (at end (hatched)))
    :effect (at end (filmed))))
