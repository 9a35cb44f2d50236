; Two robots go to the gate at the same time; the second signals there.
(define (problem two-robots)
  (:domain yard)
  (:objects r1 r2 - robot shed barn gate - place)
  (:init (at r1 shed) (at r2 barn) (= (trips r1) 0) (= (trips r2) 0))
  (:goal (and (signalled gate) (at r1 gate) (at r2 gate))))
