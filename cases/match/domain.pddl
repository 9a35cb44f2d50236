; A diver inspects welds by the light of a flare, which burns for a while and then is gone.
; The inspections cannot happen before or after: they must lie within the burning (required
; concurrency).

(define (domain flare)
  (:requirements :strips :typing :durative-actions :fluents)

  (:types flare weld)

  (:predicates
    (fresh ?f - flare)
    (bright)
    (hands-free)
    (inspected ?w - weld))

  (:functions (burn-time ?f - flare) (inspection-time ?w - weld))

  (:durative-action burn
    :parameters (?f - flare)
    :duration (= ?duration (burn-time ?f))
    :condition (at start (fresh ?f))
    :effect (and (at start (not (fresh ?f))) (at start (bright))
                 (at end (not (bright)))))

  (:durative-action inspect
    :parameters (?w - weld)
    :duration (= ?duration (inspection-time ?w))
    :condition (and (at start (hands-free))
                    (at start (bright)) (over all (bright)) (at end (bright)))
    :effect (and (at start (not (hands-free)))
                 (at end (hands-free)) (at end (inspected ?w)))))
