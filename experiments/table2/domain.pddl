; The domain of table 1 with a battery, and a product that must not weigh too much or too little.
;
; Written after the description in Cashmore et al. (2020), section 5, "Resource-Uncertain Flexible
; Execution": steps of the base draw on the battery, and the second step adds material. Rings can be
; mounted up to a weight of 110, and a product is delivered from a weight of 60 on and with a charge
; of 30 left. Throwing the workpiece away comes with a full battery.

(define (domain order-delivery-resources)
  (:requirements :strips :typing :fluents :durative-actions :timed-initial-literals)

  (:types
    robot order place - object
    shelf base-station ring-station window - place)

  (:predicates
    (at ?r - robot ?p - place)
    (hands-free ?r - robot)
    (took ?r - robot ?o - order)
    (holds ?r - robot ?o - order)
    (unserved ?o - order)
    (set-up-1) (set-up-2) (set-up-3) (set-up-4) (set-up-5) (set-up-6)
    (step-1 ?o - order) (step-2 ?o - order) (step-3 ?o - order)
    (step-4 ?o - order) (step-5 ?o - order) (step-6 ?o - order)
    (mounted ?o - order)
    (belongs ?o - order ?w - window)
    (open ?w - window)
    (delivered))

  (:functions (rings ?o - order) (weight ?o - order) (charge ?r - robot) (capacity ?r - robot))

  (:durative-action go
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration 20)
    :condition (at start (at ?r ?from))
    :effect (and (at start (not (at ?r ?from))) (at end (at ?r ?to))))

  (:durative-action collect
    :parameters (?r - robot ?s - shelf ?o - order)
    :duration (= ?duration 60)
    :condition (and (over all (at ?r ?s))
                    (at start (hands-free ?r)) (at start (unserved ?o)))
    :effect (and (at start (not (hands-free ?r))) (at start (not (unserved ?o)))
                 (at start (took ?r ?o))
                 (at end (holds ?r ?o)) (at end (set-up-1))))

  (:durative-action make-base-1
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 170)
    :condition (and (at start (set-up-1)) (over all (at ?r ?b)) (over all (holds ?r ?o))
                    (over all (>= (charge ?r) 0)))
    :effect (and (at start (not (set-up-1))) (at start (set-up-2)) (at end (step-1 ?o)) (at end (decrease (charge ?r) 20))))

  (:durative-action make-base-2
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 160)
    :condition (and (at start (set-up-2)) (over all (at ?r ?b)) (over all (holds ?r ?o))
                    (over all (>= (charge ?r) 0)))
    :effect (and (at start (not (set-up-2))) (at start (set-up-3)) (at end (step-2 ?o)) (at end (increase (weight ?o) 80))))

  (:durative-action make-base-3
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 150)
    :condition (and (at start (set-up-3)) (over all (at ?r ?b)) (over all (holds ?r ?o))
                    (over all (>= (charge ?r) 0)))
    :effect (and (at start (not (set-up-3))) (at start (set-up-4)) (at end (step-3 ?o)) (at end (decrease (charge ?r) 40))))

  (:durative-action make-base-4
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 140)
    :condition (and (at start (set-up-4)) (over all (at ?r ?b)) (over all (holds ?r ?o))
                    (over all (>= (charge ?r) 0)))
    :effect (and (at start (not (set-up-4))) (at start (set-up-5)) (at end (step-4 ?o)) (at end (decrease (charge ?r) 20))))

  (:durative-action make-base-5
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 130)
    :condition (and (at start (set-up-5)) (over all (at ?r ?b)) (over all (holds ?r ?o))
                    (over all (>= (charge ?r) 0)))
    :effect (and (at start (not (set-up-5))) (at start (set-up-6)) (at end (step-5 ?o)) (at end (decrease (charge ?r) 20))))

  (:durative-action make-base-6
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 120)
    :condition (and (at start (set-up-6)) (over all (at ?r ?b)) (over all (holds ?r ?o))
                    (over all (>= (charge ?r) 0)))
    :effect (and (at start (not (set-up-6))) (at end (step-6 ?o)) (at end (decrease (charge ?r) 20))))

  (:durative-action mount-rings
    :parameters (?r - robot ?s - ring-station ?o - order)
    :duration (= ?duration (* 120 (rings ?o)))
    :condition (and (at start (at ?r ?s)) (over all (at ?r ?s)) (at end (at ?r ?s))
                    (over all (holds ?r ?o)) (at start (<= (weight ?o) 110))
                    (at start (step-1 ?o)) (at start (step-2 ?o)) (at start (step-3 ?o)) 
                    (at start (step-4 ?o)) (at start (step-5 ?o)) (at start (step-6 ?o)))
    :effect (at end (mounted ?o)))

  (:durative-action deliver
    :parameters (?r - robot ?w - window ?o - order)
    :duration (= ?duration 1)
    :condition (and (over all (at ?r ?w)) (over all (holds ?r ?o))
                    (at start (mounted ?o)) (at start (belongs ?o ?w)) (at start (open ?w))
                    (at start (>= (weight ?o) 60)) (at start (>= (charge ?r) 30)))
    :effect (and (at end (delivered))
                 (at end (not (holds ?r ?o))) (at end (hands-free ?r))
                 (at end (decrease (charge ?r) 29))))

  (:durative-action throw-away
    :parameters (?r - robot ?s - shelf ?o - order)
    :duration (= ?duration 10)
    :condition (and (at start (took ?r ?o)) (over all (at ?r ?s)))
    :effect (and (at end (not (took ?r ?o))) (at end (unserved ?o))
                 (at end (not (holds ?r ?o))) (at end (hands-free ?r))
                 (at end (not (set-up-1))) (at end (not (set-up-2))) (at end (not (set-up-3)))
                 (at end (not (set-up-4))) (at end (not (set-up-5))) (at end (not (set-up-6)))
                 (at end (not (step-1 ?o))) (at end (not (step-2 ?o))) (at end (not (step-3 ?o)))
                 (at end (not (step-4 ?o))) (at end (not (step-5 ?o))) (at end (not (step-6 ?o)))
                 (at end (not (mounted ?o)))
                 (at end (assign (charge ?r) (capacity ?r))) (at end (assign (weight ?o) 0)))))
