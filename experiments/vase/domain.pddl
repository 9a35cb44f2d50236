; A vase is to be fetched from upstairs. There is a slide, which is the shorter way for those who do
; not slip, and there are stairs.

(define (domain house)
  (:requirements :durative-actions)

  (:predicates (upstairs) (whole) (fetched))

  (:durative-action slide
    :parameters ()
    :duration (= ?duration 10)
    :condition ()
    :effect (at end (upstairs)))

  (:durative-action climb
    :parameters ()
    :duration (= ?duration 15)
    :condition ()
    :effect (at end (upstairs)))

  (:durative-action fetch
    :parameters ()
    :duration (= ?duration 2)
    :condition (and (at start (upstairs)) (over all (whole)))
    :effect (at end (fetched))))
