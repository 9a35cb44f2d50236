; There is a long way in two parts, and a shortcut as long as nobody is on the path. All is over when the
; door closes.
(define (domain late)
  (:requirements :durative-actions :timed-initial-literals)
  (:predicates (path) (half) (there) (open))
  (:durative-action walk :parameters () :duration (= ?duration 10)
    :condition (and (at start (path)) (over all (open)))
    :effect (and (at start (not (path))) (at end (half))))
  (:durative-action climb :parameters () :duration (= ?duration 10)
    :condition (and (at start (half)) (over all (open)))
    :effect (at end (there)))
  (:durative-action slide :parameters () :duration (= ?duration 3)
    :condition (and (at start (path)) (over all (open)))
    :effect (at end (there))))
