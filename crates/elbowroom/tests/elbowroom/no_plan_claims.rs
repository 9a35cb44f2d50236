//! Claims that no plan exists: each has a certificate, and none is about a problem with a plan.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    reason = "the helpers of a test are part of it, and the random numbers have more for others"
)]

mod conflicts;
mod draft;
mod mid_execution;
mod situations;
mod unsolvable;

use std::collections::BTreeSet;

use crate::game::Random;
use elbowroom::answers::NoObserver;
use elbowroom::answers::plan::{PlanAnswer, PlanFinding, PlanRequest, PlanStop, plan};
use elbowroom::model::validate::{Settings, validate};
use elbowroom::model::{Situation, Task};
use elbowroom::no_plan::{fluents_without_value, no_plan_certificate_from};
use elbowroom::pddl::{read_plan, read_problem};
use elbowroom::text::Source;
use elbowroom::verify::no_plan::{Kind, verify_no_plan};

/// Number of random problems; one in three or four has a plan.
const PROBLEMS: usize = 2_000;

fn certificate(task: &Task) -> Result<Kind, String> {
    let mut left = 2_000;
    let found = no_plan_certificate_from(task, &Situation::initial(task), &mut || {
        left -= 1;
        left > 0
    });
    found.map(|certificate| certificate.kind())
}

#[test]
fn problem_with_a_random_valid_plan_has_no_certificate() {
    let mut random = Random(1);
    let (mut solved, mut reasons) = (0, BTreeSet::new());
    for _ in 0..PROBLEMS {
        let Some(found) = draft::solved(&mut random) else {
            continue;
        };
        solved += 1;
        match certificate(&found.task) {
            Ok(kind) => panic!("a certificate ({kind:?}) denies a plan:\n{}", found.text),
            Err(why) => reasons.insert(why),
        };
        situations::check(&found, &mut random);
    }
    // The verifier has every rule of the generator, so it rejects no certificate.
    let is_refused = |why: &&String| why.contains("verifier refuses");
    assert_eq!(reasons.iter().find(is_refused), None);
    assert!(solved > PROBLEMS / 6, "{solved} of {PROBLEMS} have a plan");
}

fn task(domain: &str, init: &str, goal: &str) -> Task {
    let domain = format!("(define (domain d) {domain})");
    let problem = format!("(define (problem p) (:domain d) (:init {init}) (:goal {goal}))");
    let texts = (
        Source::new("domain", domain),
        Source::new("problem", problem),
    );
    match read_problem(&texts.0, &texts.1) {
        Ok((read, _)) => Task::new(read),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

fn answer(task: &Task) -> PlanAnswer {
    let mut request = PlanRequest {
        task,
        first_plan_only: true,
        most_memory: Some(200 << 20),
        self_overlap: false,
        threads: 1,
    };
    plan(&mut request, &mut NoObserver).unwrap().answer
}

/// Domain, initial state, goal and a valid plan, of kinds that a search has wrongly reported as
/// unsolvable.
const SOLVABLE: &[[&str; 5]] = &[
    [
        "own start makes an over-all condition true by a conditional effect",
        "(:predicates (on) (warm) (done)) (:durative-action work :parameters () :duration (= ?duration 2)
           :condition (over all (on))
           :effect (and (when (at start (warm)) (at start (on))) (at end (done))))",
        "(warm)",
        "(done)",
        "0: (work) [2]",
    ],
    [
        "own start makes an over-all condition true by a conditional effect for all objects",
        "(:requirements :typing) (:types cell) (:constants c e - cell)
         (:predicates (full ?c - cell) (free ?c - cell) (done))
         (:durative-action drain :parameters () :duration (= ?duration 2)
           :condition (over all (and (free c) (free e)))
           :effect (and (forall (?c - cell) (when (at start (full ?c)) (at start (free ?c)))) (at end (done))))",
        "(full c) (free e)",
        "(done)",
        "0: (drain) [2]",
    ],
    [
        "own start makes an over-all negation true by a conditional deletion",
        "(:predicates (busy) (old) (done)) (:durative-action clean :parameters () :duration (= ?duration 2)
           :condition (over all (not (busy)))
           :effect (and (when (at start (old)) (at start (not (busy)))) (at end (done))))",
        "(busy) (old)",
        "(done)",
        "0: (clean) [2]",
    ],
    [
        "own start makes a derived over-all condition true",
        "(:predicates (switch) (ready) (done)) (:derived (ready) (or (switch) (done)))
         (:durative-action work :parameters () :duration (= ?duration 3)
           :condition (over all (ready)) :effect (and (at start (switch)) (at end (done))))",
        "",
        "(done)",
        "0: (work) [3]",
    ],
    [
        "own start makes the negation of a derived condition true",
        "(:predicates (noise) (loud) (done)) (:derived (loud) (noise))
         (:durative-action hush :parameters () :duration (= ?duration 3)
           :condition (over all (not (loud))) :effect (and (at start (not (noise))) (at end (done))))",
        "(noise)",
        "(done)",
        "0: (hush) [3]",
    ],
    [
        "an action twice at one moment makes its numeric over-all condition true",
        "(:requirements :fluents) (:functions (n)) (:predicates (done))
         (:durative-action push :parameters () :duration (= ?duration 2)
           :condition (over all (>= (n) 2)) :effect (and (at start (increase (n) 1)) (at end (done))))",
        "(= (n) 0)",
        "(done)",
        "0: (push) [2]\n0: (push) [2]",
    ],
    [
        "an over-all condition of an action without duration is vacuous",
        "(:predicates (p)) (:durative-action a :parameters () :duration (= ?duration 0)
           :condition (over all (p)) :effect (at end (p)))",
        "",
        "(p)",
        "0: (a) [0]",
    ],
    [
        "an over-all condition of an action that may take no time is vacuous",
        "(:requirements :duration-inequalities) (:predicates (p) (q))
         (:durative-action a :parameters () :duration (and (>= ?duration 0) (<= ?duration 4))
           :condition (over all (p)) :effect (at end (q)))",
        "",
        "(q)",
        "0: (a) [0]",
    ],
    [
        "own start makes one part of an over-all disjunction true",
        "(:predicates (a) (b) (done)) (:durative-action work :parameters () :duration (= ?duration 2)
           :condition (over all (or (a) (b))) :effect (and (at start (b)) (at end (done))))",
        "",
        "(done)",
        "0: (work) [2]",
    ],
    [
        "two starts at one moment make each other's over-all condition true",
        "(:predicates (a) (b) (x) (y))
         (:durative-action one :parameters () :duration (= ?duration 2)
           :condition (over all (b)) :effect (and (at start (a)) (at end (x))))
         (:durative-action two :parameters () :duration (= ?duration 2)
           :condition (over all (a)) :effect (and (at start (b)) (at end (y))))",
        "",
        "(and (x) (y))",
        "0: (one) [2]\n0: (two) [2]",
    ],
    [
        "two ends at one moment break each other's over-all condition",
        "(:predicates (a) (b) (x) (y))
         (:durative-action one :parameters () :duration (= ?duration 2)
           :condition (over all (b)) :effect (and (at end (not (a))) (at end (x))))
         (:durative-action two :parameters () :duration (= ?duration 2)
           :condition (over all (a)) :effect (and (at end (not (b))) (at end (y))))",
        "(a) (b)",
        "(and (x) (y))",
        "0: (one) [2]\n0: (two) [2]",
    ],
    [
        "a strict bound is met exactly at an open end",
        "(:requirements :fluents) (:functions (level)) (:predicates (done))
         (:durative-action drain :parameters () :duration (= ?duration 5)
           :condition (over all (> (level) 0))
           :effect (and (decrease (level) (* #t 2)) (at end (done))))",
        "(= (level) 10)",
        "(done)",
        "0: (drain) [5]",
    ],
    [
        "a strict bound is met exactly at the beginning",
        "(:requirements :fluents) (:functions (level)) (:predicates (done))
         (:durative-action fill :parameters () :duration (= ?duration 5)
           :condition (over all (> (level) 0))
           :effect (and (increase (level) (* #t 1)) (at end (done))))",
        "(= (level) 0)",
        "(done)",
        "0: (fill) [5]",
    ],
    [
        "two instances of an action overlap",
        "(:predicates (lit) (a) (b))
         (:durative-action burn :parameters () :duration (= ?duration 3)
           :effect (and (at start (lit)) (at end (not (lit)))))
         (:durative-action long :parameters () :duration (= ?duration 4)
           :condition (at end (lit)) :effect (and (at start (a)) (at end (b))))",
        "",
        "(b)",
        "0: (long) [4]\n2: (burn) [3]",
    ],
];

#[test]
fn solvable_problem_of_each_kind_is_not_denied() {
    for [kind, domain, init, goal, steps] in SOLVABLE {
        let task = task(domain, init, goal);
        let source = Source::new("plan", (*steps).to_owned());
        let (plan, _) = read_plan(&source, &task).unwrap();
        let verdict = validate(&task, &plan, &Settings::default());
        assert!(verdict.is_valid(), "{kind}: {verdict:?}");
        assert!(
            certificate(&task).is_err(),
            "{kind}: a certificate denies it"
        );
        let answer = answer(&task);
        assert!(
            !matches!(answer.finding, PlanFinding::NoPlan { .. }),
            "{kind}: {answer:?}"
        );
        assert_ne!(answer.stop, PlanStop::Proved, "{kind}");
    }
}

#[test]
fn unsolvable_problem_has_verified_certificate() {
    let domain =
        "(:predicates (p) (q)) (:durative-action a :parameters () :duration (= ?duration 2)
        :condition (over all (p)) :effect (at end (q)))";
    for (init, is_solvable) in [("", false), ("(p)", true), ("(at 3 (p))", true)] {
        let task = task(domain, init, "(q)");
        match answer(&task).finding {
            PlanFinding::NoPlan { certificate, .. } => {
                assert!(!is_solvable, "{init}");
                assert_eq!(verify_no_plan(&task, &certificate), Ok(()));
            }
            found => assert!(is_solvable, "{init}: {found:?}"),
        }
    }
}

#[test]
fn refutation_without_a_certificate_is_reported_as_no_plan_found() {
    // Closed sets of states ignore the least separation, and pairs ignore numbers.
    let domain = "(:requirements :fluents) (:functions (n)) (:predicates (done))
        (:durative-action hold :parameters () :duration (= ?duration 2)
          :condition (over all (>= (n) 2)) :effect (at end (done)))";
    let task = task(domain, "(= (n) 1)", "(done)");
    // No action changes the number, so this problem has a certificate.
    assert!(matches!(answer(&task).finding, PlanFinding::NoPlan { .. }));
    let domain = "(:requirements :fluents) (:functions (n)) (:predicates (free) (done))
        (:action add :parameters () :precondition (< (n) 2) :effect (increase (n) 1))
        (:durative-action hold :parameters () :duration (= ?duration 2)
          :condition (and (at start (free)) (over all (>= (n) 3)))
          :effect (and (at start (not (free))) (at end (free)) (at end (done))))";
    let task = self::task(domain, "(free) (= (n) 1)", "(done)");
    let answer = answer(&task);
    let PlanFinding::None {
        reason,
        uncertified: Some(_),
        ..
    } = &answer.finding
    else {
        panic!("{answer:?}");
    };
    assert!(reason.starts_with("no plan found"), "{reason}");
    assert_eq!(answer.stop, PlanStop::Exhausted);
}

#[test]
fn problem_that_needs_self_overlap_is_not_denied() {
    let domain = "(:requirements :fluents) (:functions (hands)) (:predicates (lifted))
        (:durative-action hold :parameters () :duration (= ?duration 2)
          :condition (at start (< (hands) 2))
          :effect (and (at start (increase (hands) 1)) (at end (decrease (hands) 1))))
        (:action lift :parameters () :precondition (>= (hands) 2) :effect (lifted))";
    let task = task(domain, "(= (hands) 0)", "(lifted)");
    let answer = answer(&task);
    let PlanFinding::None {
        reason,
        uncertified: Some(_),
        without_self_overlap: true,
    } = &answer.finding
    else {
        panic!("{answer:?}");
    };
    assert!(
        reason.starts_with("no plan without self-overlap (`--self-overlap`)"),
        "{reason}"
    );
    let mut request = PlanRequest {
        task: &task,
        first_plan_only: true,
        most_memory: Some(200 << 20),
        self_overlap: true,
        threads: 1,
    };
    let with = plan(&mut request, &mut NoObserver).unwrap().plan.unwrap();
    assert!(with.self_overlap().is_some());
}

#[test]
fn fluent_without_value_is_named() {
    let domain = "(:requirements :fluents) (:functions (used) (speed)) (:predicates (there))
        (:durative-action go :parameters () :duration (= ?duration 5)
          :effect (and (at end (there)) (at end (increase (used) 3))))";
    let task = task(domain, "", "(there)");
    let fluents = fluents_without_value(&task, &Situation::initial(&task));
    assert_eq!(fluents, ["(used)"]);
    let answer = answer(&task);
    let (PlanFinding::NoPlan { reason, .. } | PlanFinding::None { reason, .. }) = &answer.finding
    else {
        panic!("{answer:?}");
    };
    assert!(reason.contains("(used) has no initial value"), "{reason}");
    assert_eq!(certificate(&task), Ok(Kind::Reached));
    // An assignment gives the fluent a value.
    let domain = format!(
        "{domain} (:action reset :parameters () :precondition () :effect (assign (used) 0))"
    );
    let task = self::task(&domain, "", "(there)");
    assert!(fluents_without_value(&task, &Situation::initial(&task)).is_empty());
    assert!(certificate(&task).is_err());
}

#[test]
fn action_that_needs_a_derived_fact_is_not_overlooked() {
    let domain = "(:requirements :derived-predicates) (:predicates (on) (ready) (done))
        (:derived (ready) (on))
        (:durative-action work :parameters () :duration (= ?duration 1)
          :condition (at start (ready)) :effect (at end (done)))";
    let task = task(domain, "(on)", "(done)");
    assert!(certificate(&task).is_err());
}

const ERRANDS: &str = "(:requirements :typing :fluents :negative-preconditions) (:types place)
    (:constants home shop fair - place) (:functions (time ?a ?b - place) (rate) (fuel))
    (:predicates (at ?p - place) (bought) (made) (open))
    (:durative-action go :parameters (?a ?b - place) :duration (= ?duration (time ?a ?b))
      :condition (at start (at ?a)) :effect (and (at start (not (at ?a))) (at end (at ?b))))
    (:action buy :parameters () :precondition (and (at shop) (open)) :effect (bought))
    (:action fill :parameters () :precondition () :effect (increase (fuel) (rate)))
    (:action make :parameters () :precondition (>= (fuel) 5) :effect (made))";

#[test]
fn fluents_without_value_that_change_nothing_are_not_named() {
    let home_and_shop = "(at home) (= (fuel) 0) (= (time home shop) 3)";
    let cases: [(&str, String, &str, &[&str]); 5] = [
        (
            "values would not help",
            "(at home) (= (fuel) 0)".to_owned(),
            "(bought)",
            &[],
        ),
        (
            "trips to the shop, and no trip from a place to itself",
            "(at home) (open) (= (fuel) 0)".to_owned(),
            "(bought)",
            &[
                "(time fair shop)",
                "(time home fair)",
                "(time home shop)",
                "(time shop fair)",
            ],
        ),
        (
            "the way back",
            format!(
                "{home_and_shop} (open) (= (time shop fair) 1) (= (time home fair) 1) (= (time fair shop) 1)"
            ),
            "(and (bought) (at home))",
            &["(time fair home)", "(time shop home)"],
        ),
        (
            "a number that is too small",
            home_and_shop.to_owned(),
            "(made)",
            &["(rate)"],
        ),
        (
            "the goal reads it",
            home_and_shop.to_owned(),
            "(and (made) (>= (rate) 5))",
            &["(rate)"],
        ),
    ];
    for (name, init, goal, expected) in cases {
        let task = task(ERRANDS, &init, goal);
        let mut fluents = fluents_without_value(&task, &Situation::initial(&task));
        fluents.sort();
        assert_eq!(fluents, expected, "{name}");
    }
}

/// An action whose over-all condition never holds contributes to no goal, although its duration is not known to be
/// positive.
#[test]
fn fluents_of_actions_that_cannot_end_are_not_named() {
    let domain = "(:requirements :typing :fluents) (:types place) (:constants home shop - place)
        (:functions (time ?a ?b - place) (coins)) (:predicates (at ?p - place) (path ?a ?b - place) (bought))
        (:durative-action go :parameters (?a ?b - place) :duration (= ?duration (time ?a ?b))
          :condition (and (at start (at ?a)) (over all (path ?a ?b)))
          :effect (and (at start (not (at ?a))) (at end (at ?b))))
        (:action buy :parameters () :precondition (and (at shop) (>= (coins) 5)) :effect (bought))";
    let init =
        "(at home) (path home shop) (path shop home) (= (time home shop) 3) (= (time shop home) 3)";
    for (coins, expected) in [("", &["(coins)"] as &[_]), ("(= (coins) 1)", &[])] {
        let task = task(
            domain,
            &format!("{init} {coins}"),
            "(and (bought) (at home))",
        );
        let fluents = fluents_without_value(&task, &Situation::initial(&task));
        assert_eq!(fluents, expected);
    }
}

/// An action for the goal `(there)` whose condition or effect mentions `(used)`.
#[test]
fn fluent_without_value_is_named_wherever_it_is_mentioned() {
    for (condition, effect) in [
        ("(over all (> (used) 3))", "(at end (there))"),
        ("(at start (not (> (used) 3)))", "(at end (there))"),
        ("(at start (or (never) (> (used) 3)))", "(at end (there))"),
        ("(at start (much))", "(at end (there))"),
        ("(and)", "(when (at start (> (used) 3)) (at end (there)))"),
        ("(and)", "(and (at end (there)) (decrease (used) (* #t 1)))"),
        (
            "(at end (> (other) 3))",
            "(and (at end (there)) (increase (other) (* #t (used))))",
        ),
    ] {
        let domain = format!(
            "(:requirements :adl :fluents :derived-predicates :continuous-effects)
            (:functions (used) (other)) (:predicates (there) (never) (much))
            (:derived (much) (> (used) 3))
            (:durative-action go :parameters () :duration (= ?duration 5)
              :condition {condition} :effect {effect})"
        );
        let task = task(&domain, "(= (other) 0)", "(there)");
        let fluents = fluents_without_value(&task, &Situation::initial(&task));
        assert_eq!(fluents, ["(used)"], "{condition}, {effect}");
    }
}
