; To the shop across a bridge that is raised soon, or by the road around.

(define (domain crossing)
  (:requirements :strips :durative-actions :timed-initial-literals)

  (:predicates (at-home) (at-shop) (down) (open) (delivered))

  (:durative-action cross
    :parameters ()
    :duration (= ?duration 5)
    :condition (and (at start (at-home)) (at end (down)))
    :effect (and (at start (not (at-home))) (at end (at-shop))))

  (:durative-action go-round
    :parameters ()
    :duration (= ?duration 12)
    :condition (at start (at-home))
    :effect (and (at start (not (at-home))) (at end (at-shop))))

  (:durative-action hand-over
    :parameters ()
    :duration (= ?duration 2)
    :condition (and (at start (at-shop)) (at end (open)))
    :effect (at end (delivered))))
