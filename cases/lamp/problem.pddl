; One movement, one filling of oil.
;
; Worked by hand
; --------------
; Write w and l for the durations of the work and of the burning (nominally 10 and 5), W and L for
; when they start, and ε = 0.001. The work's end needs light, which comes with the lamp's start and
; goes with its end:
;
;     L + ε <= W + w                                                      (1)
;     W + w + ε <= L + l                                                  (2)
;
; Known beforehand (the weak guarantee): there are W and L as wanted exactly if
;
;     l >= 0.002,  w >= 0
;
; which is the robustness envelope.
;
; Found out while it happens (the dynamic guarantee): the lamp is lit before the work's end is seen,
; so s = L - W is fixed for all w in [w-, w+] and l in [l-, l+]:
;
;     s + ε <= w-,  w+ + ε <= s + l-         for some s, exactly if
;     w+ - w- <= l- - 0.002                                               (3)
;
; With l nominal, w in [8.75, 11.25] is such an interval: any s in [6.251, 8.749] serves, 7 for
; example, fixed beforehand. To light the lamp at the earliest moment at which some w would still be
; in its light is wrong: at s = 3.751, work that takes 8.75 ends in the light, and work that takes
; the nominal 10 does not.

(define (problem one-movement)
  (:domain lamp)

  (:init
    (oil)
    (= (working-time) 10)
    (= (burning-time) 5))

  (:goal (finished))
  (:metric minimize (total-time)))
