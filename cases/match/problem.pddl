; Two inspections in the light of one flare.
;
; Worked by hand
; --------------
; Write f, h, k for the durations of the burning and of the inspections of hull and keel
; (nominally 30, 8, 10), and ε = 0.001. The flare's start makes it bright, its end makes it dark.
; The first inspection starts at least ε after the one, the second ends at least ε before the
; other, and there is ε between the two (one pair of hands):
;
;     ε + h + ε + k + ε <= f              h + k + 0.003 <= f             (1)
;
; An inspection takes the hands at its start and frees them at its end, which interfere:
;
;     h, k >= 0.001                                                      (2)
;
; (1) and (2) are the robustness envelope. With the other durations nominal, each one alone may
; range over
;
;     f in [18.003, inf)      h in [0.001, 19.997]      k in [0.001, 21.997]
;
; Nothing is hurt by a flare that burns longer. (1) has 11.997 to spare, which the lower end of f
; and the upper ends of h and k share.

(define (problem two-welds)
  (:domain flare)

  (:objects torch - flare hull keel - weld)

  (:init
    (fresh torch)
    (hands-free)
    (= (burn-time torch) 30)
    (= (inspection-time hull) 8)
    (= (inspection-time keel) 10))

  (:goal (and (inspected hull) (inspected keel)))
  (:metric minimize (total-time)))
