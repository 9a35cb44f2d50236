; Walk and climb take 20 of the 26 seconds. Of the 6 that are left, the envelope gives walk 5. With 15.5 seconds there
; is still time to climb, until 25.501. With more than 16 there is not, but for the slide.
(define (problem late)
  (:domain late)
  (:init (path) (open) (at 26 (not (open))))
  (:goal (there)))
