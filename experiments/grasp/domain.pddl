; A robot brings a cup and a jar to the table before its battery is empty. A quick grasp may fail at
; its end, and what it was about may have fallen to the floor; a braced one takes more steps and
; hardly ever fails. What lies on the floor is lifted, and may break.

(define (domain grasp)
  (:requirements :strips :typing :durative-actions)

  (:types vessel)

  (:predicates
    (at-shelf)
    (at-table)
    (free)
    (braced)
    (charged)
    (on-shelf ?v - vessel)
    (on-floor ?v - vessel)
    (held ?v - vessel)
    (on-table ?v - vessel))

  (:durative-action fetch
    :parameters ()
    :duration (= ?duration 5)
    :condition (and (at start (at-table)) (at start (charged)))
    :effect (and (at start (not (at-table))) (at start (not (braced))) (at end (at-shelf))))

  (:durative-action bring
    :parameters ()
    :duration (= ?duration 5)
    :condition (and (at start (at-shelf)) (at start (charged)))
    :effect (and (at start (not (at-shelf))) (at start (not (braced))) (at end (at-table))))

  (:durative-action brace
    :parameters ()
    :duration (= ?duration 4)
    :condition (and (at end (at-shelf)) (at start (at-shelf)) (at start (charged)))
    :effect (at end (braced)))

  (:durative-action grasp
    :parameters (?v - vessel)
    :duration (= ?duration 2)
    :condition (and (at end (at-shelf)) (at start (at-shelf)) (at start (charged))
                    (at start (free)) (at start (on-shelf ?v)))
    :effect (and (at start (not (free))) (at start (not (on-shelf ?v))) (at end (held ?v))))

  (:durative-action grasp-braced
    :parameters (?v - vessel)
    :duration (= ?duration 2)
    :condition (and (at end (at-shelf)) (at start (at-shelf)) (at start (braced))
                    (at start (charged)) (at start (free))
                    (at start (on-shelf ?v)))
    :effect (and (at start (not (free))) (at start (not (on-shelf ?v))) (at end (held ?v))))

  (:durative-action lift
    :parameters (?v - vessel)
    :duration (= ?duration 4)
    :condition (and (at end (at-shelf)) (at start (at-shelf)) (at start (charged))
                    (at start (free)) (at start (on-floor ?v)))
    :effect (and (at start (not (free))) (at start (not (on-floor ?v))) (at end (held ?v))))

  (:durative-action put
    :parameters (?v - vessel)
    :duration (= ?duration 2)
    :condition (and (at end (at-table)) (at start (at-table)) (at start (charged))
                    (at start (held ?v)))
    :effect (and (at start (not (held ?v))) (at end (on-table ?v)) (at end (free)))))
