; Mobile robots bring crates from a rack to a truck. Durations are those of an empty floor: distance over rated speed.
(define (domain depot)
  (:requirements :strips :typing :durative-actions :fluents :timed-initial-literals)
  (:types robot place crate)
  (:predicates
    (at ?r - robot ?p - place) (charged ?r - robot) (empty ?r - robot) (holding ?r - robot ?c - crate)
    (stored ?c - crate ?p - place) (loaded ?c - crate)
    (road ?from ?to - place) (aisle ?from ?to - place) (charger ?p - place) (bay ?p - place)
    (charger-free ?p - place) (bay-free ?p - place) (docked ?r - robot ?p - place) (truck-at ?p - place))
  (:functions (drive-time ?from ?to - place) (cross-time ?from ?to - place) (charge-time ?r - robot))

  ; Along a road: long, dry and empty.
  (:durative-action drive
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration (drive-time ?from ?to))
    :condition (and (at start (at ?r ?from)) (at start (road ?from ?to)) (at start (charged ?r)))
    :effect (and (at start (not (at ?r ?from))) (at end (at ?r ?to))))

  ; Through the aisle of the cold store: short, but wet on some days, and people walk there.
  (:durative-action cross
    :parameters (?r - robot ?from ?to - place)
    :duration (= ?duration (cross-time ?from ?to))
    :condition (and (at start (at ?r ?from)) (at start (aisle ?from ?to)) (at start (charged ?r)))
    :effect (and (at start (not (at ?r ?from))) (at end (at ?r ?to))))

  (:durative-action charge
    :parameters (?r - robot ?p - place)
    :duration (= ?duration (charge-time ?r))
    :condition (and (over all (at ?r ?p)) (at start (charger ?p)) (at start (charger-free ?p)))
    :effect (and (at start (not (charger-free ?p))) (at end (charger-free ?p)) (at end (charged ?r))))

  (:durative-action pick
    :parameters (?r - robot ?c - crate ?p - place)
    :duration (= ?duration 6)
    :condition (and (over all (at ?r ?p)) (at start (empty ?r)) (at start (stored ?c ?p)))
    :effect (and (at start (not (empty ?r))) (at start (not (stored ?c ?p))) (at end (holding ?r ?c))))

  ; Only one robot at a time is in the bay. It leaves the bay when its crate is on the truck.
  (:durative-action dock
    :parameters (?r - robot ?p - place)
    :duration (= ?duration 6)
    :condition (and (at start (bay ?p)) (at start (bay-free ?p)) (at start (at ?r ?p)))
    :effect (and (at start (not (bay-free ?p))) (at start (not (at ?r ?p))) (at end (docked ?r ?p))))

  (:durative-action place
    :parameters (?r - robot ?c - crate ?p - place)
    :duration (= ?duration 6)
    :condition (and (at start (docked ?r ?p)) (at start (holding ?r ?c)) (over all (truck-at ?p)))
    :effect (and (at start (not (docked ?r ?p))) (at end (bay-free ?p)) (at end (at ?r ?p))
                 (at end (not (holding ?r ?c))) (at end (empty ?r)) (at end (loaded ?c)))))
