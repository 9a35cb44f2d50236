; The shop closes at 20, the bridge is raised at 5.001.
;
; Worked by hand
; --------------
; Write c, r and h for the durations of the crossing, of the way round and of the handing over
; (nominally 5, 12 and 2), and ε = 0.001. Whichever way is taken starts at 0 or later, the handing
; over starts ε after it has ended, and is over ε before the shop closes.
;
; Across the bridge, whose end must be ε before it is raised:
;
;     c <= 5,  c + h <= 19.998
;
; The crossing takes 5, so it has no room at all to take longer: the least share by which everything
; may deviate is 0. This is the shortest plan.
;
; By the road (plan.plan):
;
;     r + h <= 19.998
;
; r lies in [0, 17.998] and h in [0, 7.998], each with the other nominal. Both may take longer by a
; share s at the same time as long as 14 (1 + s) <= 19.998, so by 2999/7000, some 42.8 %. This plan
; takes seven seconds more.

(define (problem to-the-shop)
  (:domain crossing)

  (:init
    (at-home) (down) (open)
    (at 5.001 (not (down)))
    (at 20 (not (open))))

  (:goal (delivered))
  (:metric minimize (total-time)))
