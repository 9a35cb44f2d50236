; Two robots and two chains of three errands. There is no deadline, so every interruption can be made good,
; if nothing is done twice and nothing is forgotten. A robot whose errand failed is idle again: its world says so.
(define (problem errands)
  (:domain errands)
  (:objects r s - robot nothing a1 a2 a3 b1 b2 b3 c1 c2 - errand)
  (:init (idle r) (idle s) (done nothing)
    (open c1) (open c2) (open a1) (open a2) (open a3) (open b1) (open b2) (open b3)
    (first nothing c1) (first c1 c2) (first nothing a1) (first a1 a2) (first a2 a3)
    (first nothing b1) (first b1 b2) (first b2 b3))
  (:goal (and (done a3) (done b3))))
