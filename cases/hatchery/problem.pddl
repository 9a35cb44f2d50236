; One egg, one shot.
;
; Worked by hand
; --------------
; Write b and f for the durations of the brooding and of the shot (nominally 10 and 5), B and F for
; when they start, and ε = 0.001. The brooding's end makes `hatched` true. The shot's start needs it
; false, and its end needs it true, each at least ε away:
;
;     F + ε <= B + b                                                      (1)
;     B + b + ε <= F + f                                                  (2)
;
; Nothing else interferes.
;
; Known beforehand (the weak guarantee): for each b and f there are B and F as wanted exactly if
; the shot is long enough to hold the end of the brooding,
;
;     f >= 0.002,  b >= 0
;
; which is the robustness envelope: a box, [0, inf) and [0.002, inf).
;
; Found out while it happens (the dynamic guarantee): by (1), the shot starts before the end of the
; brooding has been seen, and when the shot ends is not for the executor to choose either. So all
; that it can do is to fix s = F - B, and that has to serve each b in [b-, b+] and f in [f-, f+]:
;
;     s + ε <= b-,  b+ + ε <= s + f-         for some s, exactly if
;     b+ - b- <= f- - 0.002                                               (3)
;
; A box keeps its promise to an executor exactly if it is inside the robustness envelope and (3)
; holds. With f nominal, the interval of b may be 4.998 wide, wherever it lies: [7.501, 12.499] is
; one, with s = 7.5. With b nominal, f in [0.002, inf). The whole envelope is no such box; whoever
; films before 8 must fear b = 13 and more, and whoever waits longer than that, b = 8.

(define (problem one-egg)
  (:domain hatchery)

  (:init
    (= (brooding-time) 10)
    (= (shot-length) 5))

  (:goal (filmed))
  (:metric minimize (total-time)))
