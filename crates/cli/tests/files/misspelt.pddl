(define (domain misspelt)
  (:requirements :strips :durative-actions)
  (:predicates (ready) (done))
  (:durative-action work
    :parameters ()
    :duration (= ?duration 5)
    :conditon (at start (raedy))
    :effect (at end (done)))
