; The advanced factory robot of paper 2, section 3: the robot goes from machine to machine. It has
; left where it was as soon as it starts to go, and has arrived when it ends.
(define (domain advanced-factory-robot)
  (:requirements :typing :durative-actions)
  (:types machine)
  (:predicates
    (machine_is_working ?m - machine)
    (machine_is_maintained ?m - machine)
    (robot_at ?m - machine))
  (:durative-action maintain_machine
    :parameters (?m - machine)
    :duration (= ?duration 1)
    :condition (and
      (at start (machine_is_working ?m)) (at start (robot_at ?m))
      (over all (machine_is_working ?m)) (over all (robot_at ?m))
      (at end (machine_is_working ?m)) (at end (robot_at ?m)))
    :effect (at end (machine_is_maintained ?m)))
  (:durative-action go_to_machine
    :parameters (?from ?to - machine)
    :duration (= ?duration 1)
    :condition (at start (robot_at ?from))
    :effect (and
      (at start (not (robot_at ?from)))
      (at end (robot_at ?to)))))
