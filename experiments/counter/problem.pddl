(define (problem before-it-closes)
  (:domain counter)
  (:objects depot shelf office - place)
  (:init
    (at depot) (free) (lies shelf) (counter office) (open)
    (way depot shelf) (way shelf office)
    (at 35.5 (not (open))))
  (:goal (handed-over))
  (:metric minimize (total-time)))
