; An effect under a condition that another action may break.
(define (domain lamp)
  (:requirements :durative-actions :conditional-effects)
  (:predicates (lit) (read))
  (:durative-action dim
    :parameters ()
    :duration (= ?duration 2)
    :condition (and)
    :effect (at end (not (lit))))
  (:durative-action study
    :parameters ()
    :duration (= ?duration 5)
    :condition (and)
    :effect (when (over all (lit)) (at end (read)))))
