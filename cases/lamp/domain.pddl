; A watchmaker works on a movement, and needs the lamp for the last touch. The oil in the lamp lasts
; for a while, and is burned once.

(define (domain lamp)
  (:requirements :strips :durative-actions :fluents)

  (:predicates (oil) (lit) (finished))

  (:functions (working-time) (burning-time))

  (:durative-action work
    :parameters ()
    :duration (= ?duration (working-time))
    :condition (at end (lit))
    :effect (at end (finished)))

  (:durative-action light
    :parameters ()
    :duration (= ?duration (burning-time))
    :condition (at start (oil))
    :effect (and (at start (not (oil))) (at start (lit)) (at end (not (lit))))))
