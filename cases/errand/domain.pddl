; Letters are brought to their houses in a town. By cab one is there at once, and pays for it; on
; foot it takes longer and costs nothing; a tram costs little, but goes from stop to stop only. The
; shortest plan is not the cheapest one.

(define (domain errand)
  (:requirements :strips :typing :durative-actions :fluents)

  (:types place letter)

  (:predicates
    (here ?p - place)
    (tram ?from ?to - place)
    (holding ?l - letter)
    (addressed ?l - letter ?p - place)
    (delivered ?l - letter))

  (:functions (distance ?from ?to - place) (money-spent))

  (:durative-action walk
    :parameters (?from ?to - place)
    :duration (= ?duration (* 10 (distance ?from ?to)))
    :condition (at start (here ?from))
    :effect (and (at start (not (here ?from))) (at end (here ?to))))

  (:durative-action ride
    :parameters (?from ?to - place)
    :duration (= ?duration (+ 5 (distance ?from ?to)))
    :condition (and (at start (here ?from)) (at start (tram ?from ?to)))
    :effect (and (at start (not (here ?from))) (at end (here ?to))
                 (at start (increase (money-spent) 3))))

  (:durative-action take-cab
    :parameters (?from ?to - place)
    :duration (= ?duration (distance ?from ?to))
    :condition (at start (here ?from))
    :effect (and (at start (not (here ?from))) (at end (here ?to))
                 (at end (increase (money-spent) (+ 4 (* 2 ?duration))))))

  (:durative-action hand-over
    :parameters (?l - letter ?p - place)
    :duration (= ?duration 1)
    :condition (and (over all (here ?p)) (at start (holding ?l))
                    (at start (addressed ?l ?p)))
    :effect (and (at start (not (holding ?l))) (at end (delivered ?l)))))
