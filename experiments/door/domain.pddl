; A robot is to fetch a key from behind a door that opens and closes by itself, or the long way round. Whoever is
; in the door when it closes is stuck.

(define (domain door)
  (:requirements :strips :typing :durative-actions :timed-initial-literals)

  (:types place)

  (:constants hall room - place)

  (:predicates (at ?p - place) (open) (day) (key))

  (:durative-action go-through
    :parameters ()
    :duration (= ?duration 6)
    :condition (and (at start (at hall)) (over all (open)))
    :effect (and (at start (not (at hall))) (at end (at room))))

  (:durative-action go-round
    :parameters ()
    :duration (= ?duration 24)
    :condition (at start (at hall))
    :effect (and (at start (not (at hall))) (at end (at room))))

  (:durative-action take-the-key
    :parameters ()
    :duration (= ?duration 4)
    :condition (and (over all (at room)) (at end (day)))
    :effect (at end (key))))
