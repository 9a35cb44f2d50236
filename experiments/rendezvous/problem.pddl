(define (problem before-the-ramp-closes)
  (:domain rendezvous)
  (:objects carrier runner - robot lab yard - place)
  (:init
    (at carrier lab) (at runner yard) (way carrier lab hub) (way runner yard hub)
    (has-box carrier) (arm runner)
    (open) (at 26 (not (open))))
  (:goal (delivered))
  (:metric minimize (total-time)))
