; Rinse a tank: fill it, then drain it to 25 or less.
;
; Worked by hand
; --------------
; Write f and d for the durations of filling and draining (nominally 15 and 10). The level is 10
; at first, rises by 2 and falls by 3 per unit of time, and must stay between 5 and 50. It is
; monotonic within each action, so its extremes are at the ends. Over-all conditions need not hold
; at the very end, but what comes arbitrarily close to a level reaches it in the limit; `<=` is
; enough there:
;
;     while filling      10 + 2f       <= 50        f <= 20               (1)
;     while draining     10 + 2f - 3d  >= 5         3d - 2f <= 5          (2)
;     goal               10 + 2f - 3d  <= 25        2f - 3d <= 15         (3)
;
; Both actions open and close the tank, which interfere, so f and d are at least ε = 0.001.
; (1), (2) and (3) are the robustness envelope, a parallelogram cut off at f = 20. With the other
; duration nominal, each one alone may range over
;
;     f in [12.5, 20]        shorter: drained below the sill (2); longer: over the brim (1)
;     d in [5, 35/3]         shorter: too much left (3); longer: below the sill (2)

(define (problem rinse)
  (:domain tank)

  (:objects barrel - tank)

  (:init
    (closed barrel)
    (untouched barrel)
    (= (level barrel) 10)
    (= (brim barrel) 50)
    (= (sill barrel) 5)
    (= (inflow barrel) 2)
    (= (outflow barrel) 3))

  (:goal (and (filled barrel) (closed barrel) (<= (level barrel) 25)))
  (:metric minimize (total-time)))
