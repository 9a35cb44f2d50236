; A rover is to take a sample and to be back before it gets dark. The short track is blocked now and then; the
; long one takes twice the charge. It can only be charged at its base.

(define (domain detour)
  (:requirements :strips :typing :durative-actions :timed-initial-literals)

  (:types place level)

  (:constants base - place)

  (:predicates
    (at ?p - place)
    (track ?from ?to - place)
    (ground ?p - place)
    (charge ?l - level)
    (next ?low ?high - level)
    (light)
    (sampled))

  (:durative-action take-the-short-track
    :parameters (?from ?to - place ?low ?high - level)
    :duration (= ?duration 8)
    :condition (and (at start (at ?from)) (at start (track ?from ?to))
                    (at start (charge ?high)) (at start (next ?low ?high)) (at end (light)))
    :effect (and (at start (not (at ?from))) (at end (at ?to))
                 (at end (not (charge ?high))) (at end (charge ?low))))

  (:durative-action take-the-long-track
    :parameters (?from ?to - place ?low ?middle ?high - level)
    :duration (= ?duration 16)
    :condition (and (at start (at ?from)) (at start (track ?from ?to))
                    (at start (charge ?high)) (at start (next ?low ?middle)) (at start (next ?middle ?high))
                    (at end (light)))
    :effect (and (at start (not (at ?from))) (at end (at ?to))
                 (at end (not (charge ?high))) (at end (charge ?low))))

  (:durative-action take-the-sample
    :parameters (?p - place)
    :duration (= ?duration 8)
    :condition (and (over all (at ?p)) (at start (ground ?p)))
    :effect (at end (sampled)))

  (:durative-action charge-up
    :parameters (?low ?high - level)
    :duration (= ?duration 8)
    :condition (and (over all (at base)) (at start (charge ?low)) (at start (next ?low ?high)))
    :effect (and (at end (not (charge ?low))) (at end (charge ?high)))))
