; A robot that fetches goods from shops, which are open at some times only. Times are minutes.
(define (domain market)
  (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals)
  (:types place goods - object
          shop - place)
  (:constants home - place)
  (:predicates
    (robot-at ?p - place)
    (open ?s - shop)
    (sells ?s - shop ?g - goods)
    (loaded ?g - goods)
    (delivered ?g - goods)
    (charged))
  (:functions
    (way ?from ?to - place)
    (tariff)
    (cost))

  (:durative-action drive
    :parameters (?from ?to - place)
    :duration (= ?duration (way ?from ?to))
    :condition (at start (robot-at ?from))
    :effect (and (at start (not (robot-at ?from))) (at end (robot-at ?to))))

  ; The shop must be open all the while.
  (:durative-action fetch
    :parameters (?g - goods ?s - shop)
    :duration (= ?duration 10)
    :condition (and (at start (sells ?s ?g))
                    (over all (robot-at ?s)) (over all (open ?s)))
    :effect (at end (loaded ?g)))

  (:durative-action unload
    :parameters (?g - goods)
    :duration (= ?duration 5)
    :condition (and (at start (loaded ?g)) (over all (robot-at home)))
    :effect (and (at start (not (loaded ?g))) (at end (delivered ?g))))

  ; An hour at the charger takes 2 kWh, at the tariff of the moment.
  (:durative-action charge
    :parameters ()
    :duration (= ?duration 60)
    :condition (over all (robot-at home))
    :effect (and (at start (increase (cost) (* 2 (tariff)))) (at end (charged)))))
