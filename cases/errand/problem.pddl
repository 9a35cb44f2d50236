; The market is far away, and the tram goes there; the mill is near it. A minute is worth as much as
; a coin would be for every four minutes.

(define (problem two-letters)
  (:domain errand)

  (:objects office market mill - place  bill card - letter)

  (:init
    (here office)
    (holding bill) (holding card)
    (addressed bill market) (addressed card mill)
    (tram office market) (tram market office)
    (= (distance office market) 6) (= (distance market office) 6)
    (= (distance market mill) 1) (= (distance mill market) 1)
    (= (distance office mill) 7) (= (distance mill office) 7)
    (= (money-spent) 0))

  (:goal (and (delivered bill) (delivered card)))

  (:metric minimize (+ (money-spent) (* 0.25 (total-time)))))
