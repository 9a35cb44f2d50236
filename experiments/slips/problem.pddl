; The parcel of cases/delivery; the counter closes at 40, where the plan takes 30.
(define (problem one-parcel-that-slips)
  (:domain delivery)
  (:objects rover - robot
            depot shelf office - place
            parcel - parcel)
  (:init
    (at rover depot)
    (idle rover)
    (lies parcel shelf)
    (counter-open office)
    (at 40 (not (counter-open office)))
    (= (drive-time depot shelf) 10) (= (drive-time shelf depot) 10)
    (= (drive-time shelf office) 15) (= (drive-time office shelf) 15)
    (= (drive-time depot office) 20) (= (drive-time office depot) 20))
  (:goal (lies parcel office))
  (:metric minimize (total-time)))
