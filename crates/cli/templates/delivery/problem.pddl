; The counter of the office closes at time 60. Times are seconds.

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
