(define (problem evening) (:domain lamp) (:init (lit)) (:goal (read)))
