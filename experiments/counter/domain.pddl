; A robot fetches a parcel and hands it over at a counter that closes. It can grasp and hand over
; quickly or carefully. Whoever grasps or hands over quickly and fails may try again.

(define (domain counter)
  (:requirements :strips :typing :durative-actions :timed-initial-literals)

  (:types place)

  (:predicates
    (at ?p - place)
    (way ?from ?to - place)
    (lies ?p - place)
    (free)
    (holds)
    (counter ?p - place)
    (open)
    (handed-over))

  (:durative-action drive
    :parameters (?from ?to - place)
    :duration (= ?duration 10)
    :condition (and (at start (at ?from)) (at start (way ?from ?to)))
    :effect (and (at start (not (at ?from))) (at end (at ?to))))

  (:durative-action grasp-quickly
    :parameters (?p - place)
    :duration (= ?duration 3)
    :condition (and (over all (at ?p)) (at start (lies ?p)) (at start (free)))
    :effect (and (at start (not (free))) (at start (not (lies ?p))) (at end (holds))))

  (:durative-action grasp-carefully
    :parameters (?p - place)
    :duration (= ?duration 6)
    :condition (and (over all (at ?p)) (at start (lies ?p)) (at start (free)))
    :effect (and (at start (not (free))) (at start (not (lies ?p))) (at end (holds))))

  (:durative-action hand-over-quickly
    :parameters (?p - place)
    :duration (= ?duration 3)
    :condition (and (over all (at ?p)) (at start (holds)) (at start (counter ?p)) (at end (open)))
    :effect (and (at start (not (holds))) (at end (free)) (at end (handed-over))))

  (:durative-action hand-over-carefully
    :parameters (?p - place)
    :duration (= ?duration 6)
    :condition (and (over all (at ?p)) (at start (holds)) (at start (counter ?p)) (at end (open)))
    :effect (and (at start (not (holds))) (at end (free)) (at end (handed-over)))))
