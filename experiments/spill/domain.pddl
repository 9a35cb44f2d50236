; A parcel is taken from a shelf, quickly or carefully, and handed over before the counter closes. What slips from
; the gripper lies on the floor, from where it can be picked up.

(define (domain spill)
  (:requirements :strips :durative-actions :timed-initial-literals)

  (:predicates
    (on-shelf)
    (on-floor)
    (in-gripper)
    (open)
    (handed-over))

  (:durative-action grasp-quickly
    :parameters ()
    :duration (= ?duration 3)
    :condition (at start (on-shelf))
    :effect (and (at start (not (on-shelf))) (at end (in-gripper))))

  (:durative-action grasp-carefully
    :parameters ()
    :duration (= ?duration 7)
    :condition (at start (on-shelf))
    :effect (and (at start (not (on-shelf))) (at end (in-gripper))))

  (:durative-action pick-up
    :parameters ()
    :duration (= ?duration 6)
    :condition (at start (on-floor))
    :effect (and (at start (not (on-floor))) (at end (in-gripper))))

  (:durative-action hand-over
    :parameters ()
    :duration (= ?duration 4)
    :condition (and (at start (in-gripper)) (at end (open)))
    :effect (and (at start (not (in-gripper))) (at end (handed-over)))))
