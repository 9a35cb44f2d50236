; The counter of the office closes at time 60. The plan is done at 30.003.
;
; Worked by hand
; --------------
; Write a, p, b, d, u for the durations of the first drive, the pick, the second drive, the drop
; and the unlocking (nominally 10, 2, 15, 3, 6), and ε = 0.001 for the least separation.
;
; One robot does a, p, b, d one after the other; each of the three hand-overs costs ε, because the
; end of one action makes `idle` true and the start of the next needs it. The drop needs the
; counter open at its end, so it must end ε before the counter closes, at 59.999 at the latest:
;
;     a + p + b + d + 3ε <= 60 - ε        a + p + b + d <= 59.996        (1)
;
; The drop also waits for the unlocking, which has nothing else to wait for:
;
;     u + ε + d <= 60 - ε                 u + d <= 59.998                (2)
;
; Each robot action deletes `idle` at its start and adds it at its end. These two happenings
; interfere, so no such action can be shorter than ε; the unlocking may take no time at all:
;
;     a, p, b, d >= 0.001,  u >= 0                                       (3)
;
; (1), (2) and (3) are the robustness envelope. With all other durations nominal, each one alone
; may range over
;
;     a in [0.001, 39.996]    p in [0.001, 31.996]    b in [0.001, 44.996]
;     d in [0.001, 32.996]    u in [0, 56.998]
;
; (1) has 29.996 to spare, and every box inside the envelope must share them out: the upper ends
; of a, p, b and d add up to 59.996 at most. How they are shared depends on the order in which a
; search widens the ends.

(define (problem one-parcel)
  (:domain delivery)

  (:objects rover - robot
            depot shelf office - place
            parcel - parcel)

  (:init
    (at rover depot)
    (idle rover)
    (lies parcel shelf)
    (counter-open office)
    (at 60 (not (counter-open office)))

    (= (drive-time depot shelf) 10) (= (drive-time shelf depot) 10)
    (= (drive-time shelf office) 15) (= (drive-time office shelf) 15)
    (= (drive-time depot office) 20) (= (drive-time office depot) 20))

  (:goal (lies parcel office))
  (:metric minimize (total-time)))
