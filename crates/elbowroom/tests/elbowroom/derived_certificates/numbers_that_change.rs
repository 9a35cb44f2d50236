//! Small problems whose conditions read numbers that the plan changes.

/// Domain, problem and plan.
pub(crate) type Texts = (&'static str, &'static str, &'static str);

/// Over-all conditions on a number that other actions change instantaneously; one is part of a
/// disjunction.
pub(crate) const LIFT: Texts = (
    "(define (domain lift)
      (:requirements :durative-actions :fluents :disjunctive-preconditions :conditional-effects)
      (:predicates (empty) (up) (stacked) (weighed) (strong))
      (:functions (load) (most) (crate))
      (:durative-action raise :parameters () :duration (= ?duration 20)
        :condition (over all (<= (load) (most))) :effect (at end (up)))
      (:durative-action stack :parameters () :duration (= ?duration 4)
        :condition (at start (>= (load) 1))
        :effect (and (at start (increase (load) (crate))) (at end (decrease (load) 1))
          (when (at start (strong)) (at end (stacked)))))
      (:durative-action weigh :parameters () :duration (= ?duration 3)
        :condition (over all (or (empty) (>= (load) 2)))
        :effect (and (at start (increase (load) 2)) (at end (weighed)))))",
    "(define (problem two) (:domain lift)
      (:init (strong) (= (load) 1) (= (most) 5) (= (crate) 2))
      (:goal (and (up) (stacked) (weighed) (<= (load) 4))))",
    "0: (raise) [20]\n2: (stack) [4]\n9: (weigh) [3]\n",
);

/// Amounts that depend on durations, at the end and, as planned, at the start; a goal on them.
pub(crate) const TAXI: Texts = (
    "(define (domain taxi)
      (:requirements :durative-actions :fluents)
      (:predicates (free) (there) (cleaned))
      (:functions (money) (fuel) (price) (dirt))
      (:durative-action drive :parameters () :duration (= ?duration 12)
        :condition (and (at start (free)) (at end (>= (- (fuel) (* 2 ?duration)) 3)))
        :effect (and (at start (not (free))) (at end (free)) (at end (there))
          (at start (decrease (money) ?duration))
          (at end (decrease (fuel) (* 2 ?duration))) (at end (increase (money) (* (price) ?duration)))
          (at end (assign (dirt) (- ?duration 9)))))
      (:durative-action clean :parameters () :duration (= ?duration 6)
        :condition (and (at start (there)) (at start (free)) (at start (<= (dirt) 7)) (over all (>= (money) 20)))
        :effect (and (at start (not (free))) (at end (free)) (at end (cleaned)))))",
    "(define (problem ride) (:domain taxi)
      (:init (free) (= (money) 15) (= (fuel) 40) (= (price) 3) (= (dirt) 1))
      (:goal (and (cleaned) (<= (fuel) 20) (>= (money) 30))))",
    "0: (drive) [12]\n13: (clean) [6]\n",
);

/// Continuous changes, with strict and other bounds, of one number by two concurrent actions.
const POND: Texts = (
    "(define (domain pond)
      (:requirements :durative-actions :fluents :continuous-effects)
      (:predicates (filled) (drained) (fed))
      (:functions (level) (food) (rate))
      (:durative-action fill :parameters () :duration (= ?duration 10)
        :condition (and (over all (< (level) 40)) (at end (> (level) 18)))
        :effect (and (increase (level) (* #t (rate))) (at start (increase (level) 1)) (at end (filled))))
      (:durative-action drain :parameters () :duration (= ?duration 5)
        :condition (and (at start (filled)) (over all (>= (level) 6)))
        :effect (and (decrease (level) (* #t 2)) (at end (drained))))
      (:durative-action feed :parameters () :duration (= ?duration 4)
        :condition (and (over all (>= (food) 1)) (at end (<= (food) 30)))
        :effect (and (decrease (food) (* #t 1)) (at end (increase (food) 2)) (at end (fed))))
      (:durative-action hoard :parameters () :duration (= ?duration 7)
        :condition (over all (<= (food) 40))
        :effect (increase (food) (* #t 1))))",
    "(define (problem garden) (:domain pond)
      (:init (= (level) 10) (= (rate) 2.5) (= (food) 9))
      (:goal (and (filled) (drained) (fed) (>= (level) 20) (<= (food) 15))))",
    "0: (fill) [10]\n1: (hoard) [7]\n3.5: (feed) [4]\n11: (drain) [5]\n",
);

/// An over-all condition on a number that another action has changed, and a rule that compares
/// numbers.
const FLASH: Texts = (
    "(define (domain flash)
      (:requirements :durative-actions :fluents :derived-predicates)
      (:predicates (shot) (bright) (charged))
      (:functions (charge) (power))
      (:derived (bright) (>= (power) 2))
      (:durative-action load :parameters () :duration (= ?duration 6) :condition (over all (bright))
        :effect (and (at end (increase (charge) (* (power) ?duration))) (at end (charged))))
      (:durative-action shoot :parameters () :duration (= ?duration 2)
        :condition (and (at start (charged)) (at start (>= (charge) 8)) (over all (<= (charge) 30)))
        :effect (at end (shot))))",
    "(define (problem portrait) (:domain flash)
      (:init (= (charge) 0) (= (power) 2)) (:goal (shot)))",
    "0: (load) [6]\n7: (shoot) [2]\n",
);

/// All problems, by name.
pub(crate) const ALL: [(&str, Texts); 4] = [
    ("lift", LIFT),
    ("taxi", TAXI),
    ("pond", POND),
    ("flash", FLASH),
];

/// Text replacements that change conditions, effects or numbers: the old part and the new one.
pub(crate) const CHANGES: [(&str, &str); 16] = [
    ("<=", ">="),
    (">=", ">"),
    ("<=", "<"),
    ("increase", "decrease"),
    ("decrease", "increase"),
    ("at start", "at end"),
    ("at end", "at start"),
    ("over all", "at end"),
    ("?duration", "5"),
    ("#t", "(* 2 #t)"),
    (" 1)", " 3)"),
    (" 2)", " 4)"),
    (" 3)", " 2)"),
    (" 6)", " 7)"),
    (" 10)", " 12)"),
    (" 20)", " 19)"),
];
