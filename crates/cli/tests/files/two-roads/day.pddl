(define (problem day) (:domain two-roads)
  (:init (home) (open))
  (:goal (signed)))
