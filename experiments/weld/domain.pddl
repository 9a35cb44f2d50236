; Two seams are to be welded with one torch before the shift is over. A seam can be welded quickly, which
; fails half of the time, or slowly.

(define (domain weld)
  (:requirements :strips :typing :durative-actions :timed-initial-literals)

  (:types seam)

  (:predicates (open ?s - seam) (torch-free) (shift) (welded ?s - seam))

  (:durative-action weld-quickly
    :parameters (?s - seam)
    :duration (= ?duration 4)
    :condition (and (at start (torch-free)) (at start (open ?s)) (at end (shift)))
    :effect (and (at start (not (torch-free))) (at end (torch-free))
                 (at end (not (open ?s))) (at end (welded ?s))))

  (:durative-action weld-slowly
    :parameters (?s - seam)
    :duration (= ?duration 7)
    :condition (and (at start (torch-free)) (at start (open ?s)) (at end (shift)))
    :effect (and (at start (not (torch-free))) (at end (torch-free))
                 (at end (not (open ?s))) (at end (welded ?s)))))
