; The simple factory robot of paper 2, section 3: three machines are to be maintained, each by one
; action that includes going there. The robot is not modelled, so nothing keeps the order.
(define (domain simple-factory-robot)
  (:requirements :typing :durative-actions)
  (:types machine)
  (:predicates
    (machine_is_working ?m - machine)
    (machine_is_maintained ?m - machine))
  (:durative-action go_maintain_machine
    :parameters (?m - machine)
    :duration (= ?duration 1)
    :condition (and
      (at start (machine_is_working ?m))
      (over all (machine_is_working ?m))
      (at end (machine_is_working ?m)))
    :effect (at end (machine_is_maintained ?m))))
