; A robot fetches goods from shops, which are open at some times only. Times are seconds.

(define (domain errands)
  (:requirements :typing :durative-actions :fluents :timed-initial-literals)

  (:types place goods - object
          shop - place)

  (:constants home - place)

  (:predicates
    (robot-at ?p - place)
    (open ?s - shop)
    (sells ?s - shop ?g - goods)
    (loaded ?g - goods)
    (delivered ?g - goods))

  (:functions (way ?from ?to - place))

  (:durative-action drive
    :parameters (?from ?to - place)
    :duration (= ?duration (way ?from ?to))
    :condition (at start (robot-at ?from))
    :effect (and (at start (not (robot-at ?from))) (at end (robot-at ?to))))

  ; The shop must be open from start to end.
  (:durative-action fetch
    :parameters (?g - goods ?s - shop)
    :duration (= ?duration 600)
    :condition (and (at start (sells ?s ?g))
                    (over all (robot-at ?s)) (over all (open ?s)))
    :effect (at end (loaded ?g)))

  (:durative-action unload
    :parameters (?g - goods)
    :duration (= ?duration 120)
    :condition (and (at start (loaded ?g)) (over all (robot-at home)))
    :effect (and (at start (not (loaded ?g))) (at end (delivered ?g)))))
