//! Small plans of our own, each of a kind that is hard to execute without knowledge of the future.

/// Problems with plans: name, domain, problem and plan.
pub(crate) const OWN: &[[&str; 4]] = &[
    [
        "an end that needs another end, which must not have come at the start",
        "(define (domain hatchery) (:requirements :durative-actions :negative-preconditions)
          (:predicates (warm) (hatched) (filmed))
          (:durative-action brood :parameters () :duration (= ?duration 10)
            :condition (at start (not (warm)))
            :effect (and (at start (warm)) (at end (hatched))))
          (:durative-action film :parameters () :duration (= ?duration 5)
            :condition (and (at start (not (hatched))) (at end (hatched)))
            :effect (at end (filmed))))",
        "(define (problem p) (:domain hatchery) (:init) (:goal (filmed)))",
        "0: (brood) [10]\n7: (film) [5]",
    ],
    [
        "a start that can go wrong because it reads what another end writes",
        "(define (domain paintshop) (:requirements :durative-actions :numeric-fluents)
          (:predicates (milled) (painted) (full)) (:functions (paint))
          (:durative-action mill :parameters () :duration (= ?duration 12)
            :condition () :effect (at end (milled)))
          (:durative-action refill :parameters () :duration (= ?duration 10)
            :condition () :effect (and (at end (increase (paint) 5)) (at end (full))))
          (:durative-action paint-it :parameters () :duration (= ?duration 4)
            :condition (and (at start (milled)) (at start (>= (paint) 2)))
            :effect (and (at start (decrease (paint) 2)) (at end (painted)))))",
        "(define (problem p) (:domain paintshop) (:init (= (paint) 2))
          (:goal (and (painted) (full))))",
        "0: (mill) [12]\n3: (refill) [10]\n12.001: (paint-it) [4]",
    ],
    [
        "an end that needs a fact which another action holds only while it runs",
        "(define (domain lamp) (:requirements :durative-actions)
          (:predicates (bright) (done) (over))
          (:durative-action work :parameters () :duration (= ?duration 10)
            :condition (at end (bright)) :effect (at end (done)))
          (:durative-action burn :parameters () :duration (= ?duration 5)
            :condition ()
            :effect (and (at start (bright)) (at end (not (bright))) (at end (over)))))",
        "(define (problem p) (:domain lamp) (:init) (:goal (and (done) (over))))",
        "0: (work) [10]\n7: (burn) [5]",
    ],
    [
        "an end that must fall into a window of timed initials",
        "(define (domain counter) (:requirements :durative-actions :timed-initial-literals)
          (:predicates (open) (packed) (handed))
          (:durative-action pack :parameters () :duration (= ?duration 3)
            :condition () :effect (at end (packed)))
          (:durative-action bring :parameters () :duration (= ?duration 6)
            :condition (and (at start (packed)) (at end (open))) :effect (at end (handed))))",
        "(define (problem p) (:domain counter)
          (:init (at 10 (open)) (at 20 (not (open)))) (:goal (handed)))",
        "0: (pack) [3]\n8: (bring) [6]",
    ],
    [
        "an end that needs another end and has a deadline",
        "(define (domain kitchen) (:requirements :durative-actions :timed-initial-literals)
          (:predicates (cooked) (served) (noon))
          (:durative-action cook :parameters () :duration (= ?duration 10)
            :condition () :effect (at end (cooked)))
          (:durative-action serve :parameters () :duration (= ?duration 5)
            :condition (and (at end (cooked)) (at end (noon))) :effect (at end (served))))",
        "(define (problem p) (:domain kitchen)
          (:init (noon) (at 30 (not (noon)))) (:goal (served)))",
        "0: (cook) [10]\n7: (serve) [5]",
    ],
    [
        "one action that must end within another",
        "(define (domain handover) (:requirements :durative-actions)
          (:predicates (reaching) (given) (taken))
          (:durative-action reach :parameters () :duration (= ?duration 8)
            :condition (at end (given))
            :effect (and (at start (reaching)) (at end (not (reaching))) (at end (taken))))
          (:durative-action give :parameters () :duration (= ?duration 6)
            :condition (at end (reaching)) :effect (at end (given))))",
        "(define (problem p) (:domain handover) (:init) (:goal (taken)))",
        "0: (give) [6]\n2: (reach) [8]",
    ],
    [
        "two ends at one moment that neither needs",
        "(define (domain fuse) (:requirements :durative-actions)
          (:predicates (light) (mended) (burnt))
          (:durative-action strike :parameters () :duration (= ?duration 5)
            :condition ()
            :effect (and (at start (light)) (at end (not (light))) (at end (burnt))))
          (:durative-action mend :parameters () :duration (= ?duration 4)
            :condition (over all (light)) :effect (at end (mended))))",
        "(define (problem p) (:domain fuse) (:init) (:goal (and (mended) (burnt))))",
        "0: (strike) [5]\n1: (mend) [4]",
    ],
    [
        "an over-all condition that comes from an action which starts at the same moment",
        "(define (domain pump) (:requirements :durative-actions)
          (:predicates (pressure) (clean) (empty))
          (:durative-action spray :parameters () :duration (= ?duration 5)
            :condition (over all (pressure)) :effect (at end (clean)))
          (:durative-action run :parameters () :duration (= ?duration 10)
            :condition ()
            :effect (and (at start (pressure)) (at end (not (pressure))) (at end (empty)))))",
        "(define (problem p) (:domain pump) (:init) (:goal (and (clean) (empty))))",
        "0: (spray) [5]\n0: (run) [10]",
    ],
    [
        "a strict comparison that becomes an equality at the end",
        "(define (domain candle)
          (:requirements :durative-actions :numeric-fluents :continuous-effects)
          (:predicates (read)) (:functions (wax))
          (:durative-action read-on :parameters () :duration (= ?duration 10)
            :condition (over all (> (wax) 0))
            :effect (and (decrease (wax) (* #t 1)) (at end (read)))))",
        "(define (problem p) (:domain candle) (:init (= (wax) 10)) (:goal (read)))",
        "0: (read-on) [10]",
    ],
    [
        "an action that takes no time",
        "(define (domain post) (:requirements :durative-actions)
          (:predicates (written) (stamped) (sent))
          (:durative-action write :parameters () :duration (= ?duration 5)
            :condition () :effect (at end (written)))
          (:durative-action stamp :parameters () :duration (= ?duration 0)
            :condition (at start (written)) :effect (at end (stamped)))
          (:durative-action send :parameters () :duration (= ?duration 2)
            :condition (at start (stamped)) :effect (at end (sent))))",
        "(define (problem p) (:domain post) (:init) (:goal (sent)))",
        "0: (write) [5]\n5.001: (stamp) [0]\n5.002: (send) [2]",
    ],
    [
        "three jobs that drain one battery",
        "(define (domain drain) (:requirements :durative-actions :numeric-fluents :typing)
          (:types job) (:predicates (done ?j - job)) (:functions (charge))
          (:durative-action do :parameters (?j - job) :duration (= ?duration 10)
            :condition (over all (>= (charge) 0))
            :effect (and (at end (decrease (charge) ?duration)) (at end (done ?j)))))",
        "(define (problem p) (:domain drain) (:objects a b c - job)
          (:init (= (charge) 39))
          (:goal (and (done a) (done b) (done c) (>= (charge) 0))))",
        "0: (do a) [10]\n0.001: (do b) [10]\n0.002: (do c) [10]",
    ],
    [
        "a start that must follow another start",
        "(define (domain hoist) (:requirements :durative-actions)
          (:predicates (raised) (clear) (moved) (down))
          (:durative-action lift :parameters () :duration (= ?duration 9)
            :condition ()
            :effect (and (at start (raised)) (at end (not (raised))) (at end (down))))
          (:durative-action sweep :parameters () :duration (= ?duration 3)
            :condition (and (at start (raised)) (over all (raised)))
            :effect (and (at start (clear)) (at end (not (clear)))))
          (:durative-action move :parameters () :duration (= ?duration 1)
            :condition (and (over all (clear)) (over all (raised)))
            :effect (at end (moved))))",
        "(define (problem p) (:domain hoist) (:init) (:goal (and (moved) (down))))",
        "0: (lift) [9]\n1: (sweep) [3]\n2: (move) [1]",
    ],
];
