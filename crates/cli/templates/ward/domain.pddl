; Two robots carry goods from the pharmacy to the wards of a hospital. A ward accepts goods only during its visiting
; hours. Each move takes energy from the battery, and a robot can charge at the dock. Times are seconds.

(define (domain ward)
  (:requirements :strips :typing :durative-actions :fluents :timed-initial-literals)

  (:types robot place item)

  (:predicates
    (at ?r - robot ?p - place)
    (idle ?r - robot)
    (empty ?r - robot)
    (lies ?i - item ?p - place)
    (carries ?r - robot ?i - item)
    (visiting-hours ?p - place)
    (has-charger ?p - place))

  (:functions
    (way ?from ?to - place)
    (battery ?r - robot))

  (:durative-action move
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration (way ?from ?to))
    :condition (and (at start (at ?r ?from)) (at start (idle ?r))
                    (at start (>= (battery ?r) (way ?from ?to))))
    :effect (and (at start (not (at ?r ?from))) (at start (not (idle ?r)))
                 (at start (decrease (battery ?r) (way ?from ?to)))
                 (at end (at ?r ?to)) (at end (idle ?r))))

  (:durative-action load
    :parameters (?r - robot ?i - item ?p - place)
    :duration (= ?duration 5)
    :condition (and (at start (at ?r ?p)) (at start (idle ?r)) (at start (empty ?r))
                    (at start (lies ?i ?p)))
    :effect (and (at start (not (idle ?r))) (at start (not (empty ?r)))
                 (at start (not (lies ?i ?p)))
                 (at end (carries ?r ?i)) (at end (idle ?r))))

  (:durative-action deliver
    :parameters (?r - robot ?i - item ?p - place)
    :duration (= ?duration 10)
    :condition (and (at start (at ?r ?p)) (at start (idle ?r)) (at start (carries ?r ?i))
                    (over all (visiting-hours ?p)))
    :effect (and (at start (not (idle ?r)))
                 (at end (not (carries ?r ?i))) (at end (empty ?r))
                 (at end (lies ?i ?p)) (at end (idle ?r))))

  (:durative-action charge
    :parameters (?r - robot ?p - place)
    :duration (= ?duration 40)
    :condition (and (at start (at ?r ?p)) (at start (idle ?r)) (at start (has-charger ?p)))
    :effect (and (at start (not (idle ?r)))
                 (at end (assign (battery ?r) 200)) (at end (idle ?r)))))
