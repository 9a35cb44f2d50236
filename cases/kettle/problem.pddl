; Tea: the kettle decides when the water boils, and the tea is poured before it is too cold.
;
; Worked by hand (tea.stn)
; ------------------------
; Write r for how long the tap runs, and w for the time from switching on to pouring (nominally 8
; and 15).
;
;     level, switched on    2r       >= 12     r >= 6      (1)
;     the sink              2r       <= 20     r <= 10     (2)
;
; The kettle takes (100 - 20) / 10 = 8 to boil, and switches itself off. The pouring reads that it
; has boiled, and comes at least ε = 0.001 later:
;
;     boiled                w        >= 8.001              (3)
;     heat                  100 - (w - 8) / 2 >= 90        w <= 28     (4)
;
; The leaves are there 6 after switching on, before the water boils. (1) to (4) are a box.

(define (problem tea)
  (:domain kettle)

  (:init
    (empty)
    (= (level) 0)
    (= (capacity) 20)
    (= (flow) 2)
    (= (heat) 20)
    (= (power) 10)
    (= (loss) 1/2))

  (:goal (and (tea) (not (wet)))))
