; A robot prepares one of two orders and delivers it before its window closes.
;
; Written after the description in Cashmore et al. (2020), section 5: a workpiece is fetched from a
; shelf, a base is made of it in six steps that may run side by side, rings are mounted, and the
; product is delivered at the order's window. An order can be dropped at any time: then the
; workpiece is thrown away at the shelf, and everything begins anew.
;
; A step of the base can start once the step before it has started; its machine then is set up for
; the next step, until the workpiece is thrown away.

(define (domain order-delivery)
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

  (:functions (rings ?o - order))

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
    :condition (and (at start (set-up-1)) (over all (at ?r ?b)) (over all (holds ?r ?o)))
    :effect (and (at start (not (set-up-1))) (at start (set-up-2)) (at end (step-1 ?o))))

  (:durative-action make-base-2
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 160)
    :condition (and (at start (set-up-2)) (over all (at ?r ?b)) (over all (holds ?r ?o)))
    :effect (and (at start (not (set-up-2))) (at start (set-up-3)) (at end (step-2 ?o))))

  (:durative-action make-base-3
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 150)
    :condition (and (at start (set-up-3)) (over all (at ?r ?b)) (over all (holds ?r ?o)))
    :effect (and (at start (not (set-up-3))) (at start (set-up-4)) (at end (step-3 ?o))))

  (:durative-action make-base-4
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 140)
    :condition (and (at start (set-up-4)) (over all (at ?r ?b)) (over all (holds ?r ?o)))
    :effect (and (at start (not (set-up-4))) (at start (set-up-5)) (at end (step-4 ?o))))

  (:durative-action make-base-5
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 130)
    :condition (and (at start (set-up-5)) (over all (at ?r ?b)) (over all (holds ?r ?o)))
    :effect (and (at start (not (set-up-5))) (at start (set-up-6)) (at end (step-5 ?o))))

  (:durative-action make-base-6
    :parameters (?r - robot ?b - base-station ?o - order)
    :duration (= ?duration 120)
    :condition (and (at start (set-up-6)) (over all (at ?r ?b)) (over all (holds ?r ?o)))
    :effect (and (at start (not (set-up-6))) (at end (step-6 ?o))))

  (:durative-action mount-rings
    :parameters (?r - robot ?s - ring-station ?o - order)
    :duration (= ?duration (* 60 (rings ?o)))
    :condition (and (at start (at ?r ?s)) (over all (at ?r ?s)) (at end (at ?r ?s))
                    (over all (holds ?r ?o))
                    (at start (step-1 ?o)) (at start (step-2 ?o)) (at start (step-3 ?o)) 
                    (at start (step-4 ?o)) (at start (step-5 ?o)) (at start (step-6 ?o)))
    :effect (at end (mounted ?o)))

  (:durative-action deliver
    :parameters (?r - robot ?w - window ?o - order)
    :duration (= ?duration 1)
    :condition (and (over all (at ?r ?w)) (over all (holds ?r ?o))
                    (at start (mounted ?o)) (at start (belongs ?o ?w)) (at start (open ?w)))
    :effect (and (at end (delivered))
                 (at end (not (holds ?r ?o))) (at end (hands-free ?r))))

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
                 (at end (not (mounted ?o))))))
