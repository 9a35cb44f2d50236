; A rover surveys sites, which drains its battery in proportion to the time it takes, and charges
; in between. It must never begin to eat its reserve, and must not overcharge.

(define (domain battery)
  (:requirements :strips :typing :durative-actions :fluents :duration-inequalities)

  (:types rover site)

  (:predicates
    (idle ?r - rover)
    (surveyed ?s - site))

  (:functions
    (charge ?r - rover)      ; what is in the battery
    (capacity ?r - rover)    ; what fits into it
    (reserve ?r - rover)     ; what must stay in it
    (draw ?r - rover)        ; used per unit of time when surveying
    (supply ?r - rover)      ; gained per unit of time when charging
    (survey-time ?s - site))

  (:durative-action survey
    :parameters (?r - rover ?s - site)
    :duration (= ?duration (survey-time ?s))
    :condition (and (at start (idle ?r))
                    (at end (>= (- (charge ?r) (* (draw ?r) ?duration)) (reserve ?r))))
    :effect (and (at start (not (idle ?r)))
                 (at end (decrease (charge ?r) (* (draw ?r) ?duration)))
                 (at end (surveyed ?s)) (at end (idle ?r))))

  (:durative-action recharge
    :parameters (?r - rover)
    :duration (and (>= ?duration 1) (<= ?duration 20))
    :condition (and (at start (idle ?r))
                    (at end (<= (+ (charge ?r) (* (supply ?r) ?duration)) (capacity ?r))))
    :effect (and (at start (not (idle ?r)))
                 (at end (increase (charge ?r) (* (supply ?r) ?duration)))
                 (at end (idle ?r)))))
