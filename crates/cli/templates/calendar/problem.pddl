; Bread and medicine for a household. The opening hours of the shops are in calendar.toml.

(define (problem household)
  (:domain errands)

  (:objects
    bakery pharmacy - shop
    bread medicine - goods)

  (:init
    (robot-at home)
    (sells bakery bread)
    (sells pharmacy medicine)
    (= (way home bakery) 900) (= (way bakery home) 900)
    (= (way home pharmacy) 1200) (= (way pharmacy home) 1200)
    (= (way bakery pharmacy) 600) (= (way pharmacy bakery) 600))

  (:goal (and (delivered bread) (delivered medicine)))
  (:metric minimize (total-time)))
