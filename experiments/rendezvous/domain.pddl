; Two robots meet at a hub, where one hands a box to the other; each waits for the other. The box is to be on
; the ramp there before the ramp closes, and only one robot has an arm to lift it with. It can be handed over quickly
; or carefully.

(define (domain rendezvous)
  (:requirements :strips :typing :durative-actions :timed-initial-literals)

  (:types robot place)

  (:constants hub - place)

  (:predicates
    (at ?r - robot ?p - place)
    (way ?r - robot ?from ?to - place)
    (has-box ?r - robot)
    (arm ?r - robot)
    (open)
    (delivered))

  (:durative-action drive
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration 8)
    :condition (and (at start (at ?r ?from)) (at start (way ?r ?from ?to)))
    :effect (and (at start (not (at ?r ?from))) (at end (at ?r ?to))))

  (:durative-action hand-over-quickly
    :parameters (?from ?to - robot)
    :duration (= ?duration 4)
    :condition (and (over all (at ?from hub)) (over all (at ?to hub)) (at start (arm ?to))
                    (at start (has-box ?from)))
    :effect (and (at start (not (has-box ?from))) (at end (has-box ?to))))

  (:durative-action hand-over-carefully
    :parameters (?from ?to - robot)
    :duration (= ?duration 8)
    :condition (and (over all (at ?from hub)) (over all (at ?to hub)) (at start (arm ?to))
                    (at start (has-box ?from)))
    :effect (and (at start (not (has-box ?from))) (at end (has-box ?to))))

  (:durative-action unload
    :parameters (?r - robot)
    :duration (= ?duration 4)
    :condition (and (over all (at ?r hub)) (at start (arm ?r)) (at start (has-box ?r)) (at end (open)))
    :effect (and (at start (not (has-box ?r))) (at end (delivered)))))
