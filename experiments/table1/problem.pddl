; Two orders: one ring and an early window, or three rings and a late one. One delivery is enough.
;
; `{early}` and `{late}` are filled in by table1.toml.

(define (problem two-orders)
  (:domain order-delivery)
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
    (unserved simple) (= (rings simple) 1)
    (unserved fancy) (= (rings fancy) 3)
    (belongs simple front) (open front) (at {early} (not (open front)))
    (belongs fancy back) (open back) (at {late} (not (open back))))
  (:goal (delivered))
  (:metric minimize (total-time)))
