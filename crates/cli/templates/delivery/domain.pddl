; A robot fetches a parcel and hands it over at a counter that closes.
;
; `drop` needs the counter open when it ends, so a counter that closes by a timed initial literal
; is a deadline. `idle` keeps one robot from doing two things at once.

(define (domain delivery)
  (:requirements :strips :typing :durative-actions :fluents :timed-initial-literals)

  (:types robot place parcel)

  (:predicates
    (at ?r - robot ?p - place)
    (lies ?x - parcel ?p - place)
    (carries ?r - robot ?x - parcel)
    (idle ?r - robot)
    (unlocked ?p - place)
    (counter-open ?p - place))

  (:functions (drive-time ?from ?to - place))

  (:durative-action drive
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration (drive-time ?from ?to))
    :condition (and (at start (at ?r ?from)) (at start (idle ?r)))
    :effect (and (at start (not (at ?r ?from))) (at start (not (idle ?r)))
                 (at end (at ?r ?to)) (at end (idle ?r))))

  (:durative-action pick
    :parameters (?r - robot ?x - parcel ?p - place)
    :duration (= ?duration 2)
    :condition (and (at start (at ?r ?p)) (at start (idle ?r)) (at start (lies ?x ?p)))
    :effect (and (at start (not (idle ?r))) (at start (not (lies ?x ?p)))
                 (at end (carries ?r ?x)) (at end (idle ?r))))

  (:durative-action drop
    :parameters (?r - robot ?x - parcel ?p - place)
    :duration (= ?duration 3)
    :condition (and (at start (at ?r ?p)) (at start (idle ?r)) (at start (carries ?r ?x))
                    (at start (unlocked ?p))
                    (at end (counter-open ?p)))
    :effect (and (at start (not (idle ?r))) (at start (not (carries ?r ?x)))
                 (at end (lies ?x ?p)) (at end (idle ?r))))

  ; A person does this while the robot drives.
  (:durative-action unlock
    :parameters (?p - place)
    :duration (= ?duration 6)
    :condition ()
    :effect (at end (unlocked ?p))))
