(define (problem before-it-gets-dark)
  (:domain detour)
  (:objects crater - place empty one two three - level)
  (:init
    (at base) (ground crater) (track base crater) (track crater base)
    (charge one) (next empty one) (next one two) (next two three)
    (light) (at 52 (not (light))))
  (:goal (and (sampled) (at base)))
  (:metric minimize (total-time)))
