; Two orders, as in table 1, with fixed windows. How much charge there is, table2.toml fills in.

(define (problem two-orders)
  (:domain order-delivery-resources)
  (:objects
    rover - robot
    store - shelf
    press - base-station
    mounting - ring-station
    simple fancy - order
    front back - window)
  (:init
    (at rover store)
    (hands-free rover)
    (= (capacity rover) {capacity}) (= (charge rover) {charge})
    (unserved simple) (= (rings simple) 1) (= (weight simple) 0)
    (unserved fancy) (= (rings fancy) 3) (= (weight fancy) 0)
    (belongs simple front) (open front) (at 460 (not (open front)))
    (belongs fancy back) (open back) (at 1010 (not (open back))))
  (:goal (delivered))
  (:metric minimize (total-time)))
