; A kettle that switches itself off when the water boils, and a sink that overflows.

(define (domain kettle)
  (:requirements :typing :fluents :durative-actions :time :negative-preconditions)

  (:predicates (empty) (filled) (heating) (boiled) (wet) (leaves) (tea))
  (:functions (level) (capacity) (flow)
              (heat) (power) (loss))

  ; The tap runs for as long as it takes.
  (:durative-action fill
    :parameters ()
    :duration (= ?duration 8)
    :condition (and (at start (empty)) (over all (not (wet))))
    :effect (and (at start (not (empty))) (at end (filled))
                 (increase (level) (* #t (flow)))))

  (:event overflow
    :parameters ()
    :precondition (and (> (level) (capacity)) (not (wet)))
    :effect (wet))

  (:action switch-on
    :parameters ()
    :precondition (and (filled) (>= (level) 12))
    :effect (heating))

  (:process heats
    :parameters ()
    :precondition (heating)
    :effect (increase (heat) (* #t (power))))

  (:event boils
    :parameters ()
    :precondition (and (heating) (>= (heat) 100))
    :effect (and (not (heating)) (boiled)))

  (:process cools
    :parameters ()
    :precondition (boiled)
    :effect (decrease (heat) (* #t (loss))))

  (:durative-action fetch-leaves
    :parameters ()
    :duration (= ?duration 5)
    :condition ()
    :effect (at end (leaves)))

  (:action pour
    :parameters ()
    :precondition (and (leaves) (boiled) (>= (heat) 90))
    :effect (tea)))
