(define (problem closing) (:domain two-roads)
  (:init (home) (open) (at 10 (not (open))))
  (:goal (delivered)))
