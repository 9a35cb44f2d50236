; Two surveys with a charge in between. Nothing here depends on the clock: the battery limits
; every duration, some of them from both sides.
;
; Worked by hand
; --------------
; Write a, c, b for the durations of the survey of the crater, the recharge and the survey of the
; boulder (nominally 20, 10, 30). The battery holds 80 at first; surveying takes 2 per unit of
; time, charging gives 4; at least 10 must stay, at most 100 fit.
;
;     after the crater      80 - 2a            >= 10        a <= 35             (1)
;     after charging        80 - 2a + 4c       <= 100       2c - a <= 10        (2)
;     after the boulder     80 - 2a + 4c - 2b  >= 10        a + b - 2c <= 35    (3)
;
; Each action deletes `idle` at its start and adds it at its end, which interfere, so a, c, b are
; at least ε = 0.001. (The domain's bounds on the recharge, 1 and 20, bind the planner; a duration
; that is left open to find out how far it may go is not bound by them.)
;
; (1), (2), (3) are the robustness envelope; (1) follows from the others where c is nominal. With
; the other durations nominal, each one alone may range over
;
;     a in [10, 25]       shorter: the recharge overfills (2); longer: too little is left (3)
;     c in [7.5, 15]      shorter: too little is left (3); longer: it overfills (2)
;     b in [0.001, 35]    longer: too little is left (3)
;
; (3) has 5 to spare, of which a box gives each unit to a longer a, a longer b, or half a unit to
; a shorter c; (2) has 10 to spare between a shorter a and a longer c.

(define (problem two-sites)
  (:domain battery)

  (:objects rover - rover crater boulder - site)

  (:init
    (idle rover)
    (= (charge rover) 80)
    (= (capacity rover) 100)
    (= (reserve rover) 10)
    (= (draw rover) 2)
    (= (supply rover) 4)
    (= (survey-time crater) 20)
    (= (survey-time boulder) 30))

  (:goal (and (surveyed crater) (surveyed boulder)))
  (:metric minimize (total-time)))
