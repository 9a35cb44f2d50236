(define (domain errands)
  (:requirements :typing :durative-actions)
  (:types robot errand)
  (:predicates (idle ?r - robot) (open ?e - errand) (done ?e - errand) (first ?e ?f - errand))
  (:durative-action do
    :parameters (?r - robot ?e ?f - errand)
    :duration (= ?duration 2)
    :condition (and (at start (idle ?r)) (at start (open ?f)) (at start (first ?e ?f)) (at start (done ?e)))
    :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (done ?f)))))
