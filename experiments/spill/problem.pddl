(define (problem before-the-counter-closes)
  (:domain spill)
  (:init
    (on-shelf)
    (open) (at 16.5 (not (open))))
  (:goal (handed-over))
  (:metric minimize (total-time)))
