; One part. The refilling ends just after the painting has started.
;
; Worked by hand
; --------------
; Write m, r, p for the durations of milling, refilling and painting (nominally 12, 10, 4), M, R, P
; for when they start, and ε = 0.001. The painting's start needs the part milled, and reads how much
; paint there is, which the refilling's end changes. In the plan the painting starts first, and
; happenings that interfere keep their order:
;
;     M + m + ε <= P                                                      (1)
;     P + ε <= R + r                                                      (2)
;
; The pot holds 2 when the painting starts, as much as it takes; in the end it holds 5.
;
; Known beforehand (the weak guarantee): whatever m, r and p are, a late enough P satisfies (1), and
; a late enough R (2). So the robustness envelope is everything: m, r, p in [0, inf).
;
; Found out while it happens (the dynamic guarantee): P may wait until the milling has been seen to
; end, and R may wait until the painting has started, plus ε; then (2) holds even if r = 0. So the
; whole envelope is a box whose promise can be kept. But not by starting the refilling as soon as
; some r and m would allow it: with m <= m+ and r >= r-, an executor may start it at
;
;     R = M + m+ + 2ε - r-      or as soon after the milling's end as P + ε - r- allows
;
; and no sooner. With the nominal values that is 2.002; at 0, where nothing but (1) and (2) with r
; and m of the executor's own choosing would put it, it ends at 10, before the painting can start.

(define (problem one-part)
  (:domain paintshop)

  (:init
    (= (milling-time) 12)
    (= (refilling-time) 10)
    (= (painting-time) 4)
    (= (paint) 2))

  (:goal (and (painted) (>= (paint) 5)))
  (:metric minimize (total-time)))
