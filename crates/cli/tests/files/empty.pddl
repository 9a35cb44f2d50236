(define (problem empty) (:domain misspelt) (:init) (:goal (done)))
