; Bread and medicine for a household. When the shops are open and what energy costs is in calendar.toml.
;
; By hand, with time 0 on Wednesday, 23 December 2026, 16:30: the pharmacy is 40 minutes away and closes at 17:00. The
; next days are holidays and a Sunday, so the medicine can be fetched from Monday, 28 December, 8:00. That is 5 days
; less 8.5 hours after time 0, at 7200 - 510 = 6690 minutes, and it is at home after 6690 + 10 + 40 + 5 = 6745 minutes.
(define (problem household)
  (:domain market)
  (:objects bakery pharmacy - shop bread medicine - goods)
  (:init
    (robot-at home)
    (sells bakery bread)
    (sells pharmacy medicine)
    (= (way home bakery) 30) (= (way bakery home) 30)
    (= (way home pharmacy) 40) (= (way pharmacy home) 40)
    (= (way bakery pharmacy) 20) (= (way pharmacy bakery) 20)
    (= (cost) 0))
  (:goal (and (delivered bread) (delivered medicine) (charged)))
  (:metric minimize (cost)))
