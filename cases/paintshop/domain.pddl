; A part is milled and painted. The paint is refilled meanwhile; what is in the pot at first is
; enough for this part.

(define (domain paintshop)
  (:requirements :strips :durative-actions :fluents)

  (:predicates (milled) (painted))

  (:functions (milling-time) (refilling-time) (painting-time) (paint))

  (:durative-action mill
    :parameters ()
    :duration (= ?duration (milling-time))
    :condition ()
    :effect (at end (milled)))

  (:durative-action refill
    :parameters ()
    :duration (= ?duration (refilling-time))
    :condition ()
    :effect (at end (increase (paint) 5)))

  (:durative-action paint-it
    :parameters ()
    :duration (= ?duration (painting-time))
    :condition (and (at start (milled)) (at start (>= (paint) 2)))
    :effect (and (at start (decrease (paint) 2)) (at end (painted)))))
