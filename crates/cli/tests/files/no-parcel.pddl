; There is no parcel anywhere, so none can be delivered.
(define (problem no-parcel)
  (:domain delivery)
  (:objects rover - robot
            depot office - place
            parcel - parcel)
  (:init
    (at rover depot)
    (idle rover)
    (counter-open office)
    (= (drive-time depot office) 20) (= (drive-time office depot) 20))
  (:goal (lies parcel office)))
