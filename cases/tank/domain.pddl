; A tank is filled and drained; its level changes continuously meanwhile.

(define (domain tank)
  (:requirements :strips :typing :durative-actions :fluents :duration-inequalities
                 :continuous-effects)

  (:types tank)

  (:predicates (closed ?t - tank) (untouched ?t - tank) (filled ?t - tank))

  (:functions
    (level ?t - tank)
    (brim ?t - tank)       ; the level must not rise above
    (sill ?t - tank)       ; nor fall below
    (inflow ?t - tank)
    (outflow ?t - tank))

  (:durative-action fill
    :parameters (?t - tank)
    :duration (and (>= ?duration 1) (<= ?duration 60))
    :condition (and (at start (closed ?t)) (at start (untouched ?t))
                    (over all (<= (level ?t) (brim ?t))))
    :effect (and (at start (not (closed ?t))) (at start (not (untouched ?t)))
                 (increase (level ?t) (* #t (inflow ?t)))
                 (at end (closed ?t)) (at end (filled ?t))))

  (:durative-action drain
    :parameters (?t - tank)
    :duration (and (>= ?duration 1) (<= ?duration 60))
    :condition (and (at start (closed ?t)) (at start (filled ?t))
                    (over all (>= (level ?t) (sill ?t))))
    :effect (and (at start (not (closed ?t)))
                 (decrease (level ?t) (* #t (outflow ?t)))
                 (at end (closed ?t)))))
