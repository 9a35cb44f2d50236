//! Certificates that no plan exists. An independent checker on a time grid confirms accepted
//! certificates, and a planner finds no plan. A modified certificate is either rejected or still a
//! proof.

#![allow(
    clippy::unwrap_used,
    clippy::format_push_string,
    dead_code,
    reason = "the helpers of a test are part of it, and the random numbers have more for others"
)]

mod draft;

use std::ops::ControlFlow;

use crate::game::Random;
use draft::Draft;
use elbowroom_model::validate::Settings as Strictness;
use elbowroom_model::{Situation, Task, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_planner::{Answer, Settings, plan};
use elbowroom_verify::Exact;
use elbowroom_verify::no_plan::{
    Instances, MAX_STEPS, NoPlan, NoPlanFlaw, ReachedFacts, no_plan_certificate, verify_no_plan,
};

fn task(domain: &str, problem: &str) -> Task {
    let domain = Source::new("domain", format!("(define (domain d) {domain})"));
    let problem = format!("(define (problem p) (:domain d) {problem})");
    match read_problem(&domain, &Source::new("problem", problem)) {
        Ok((problem, _)) => Task::new(problem),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

/// Returns all reached facts with their earliest times.
fn listed(task: &Task) -> ReachedFacts {
    let mut instances = Instances::of(task).unwrap();
    let mut reached = ReachedFacts::new();
    loop {
        instances.extend(&reached, MAX_STEPS).unwrap();
        let breaches = instances.breaches(&reached);
        if breaches.is_empty() {
            return reached;
        }
        for breach in breaches {
            let from = reached
                .entry(breach.fact)
                .or_insert_with(|| breach.time.clone());
            *from = Rational::min(from.clone(), breach.time);
        }
    }
}

fn has_plan(task: &Task) -> bool {
    let mut turns = 0;
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    let answer = plan(task, &Situation::initial(task), &settings, &mut |_| {
        turns += 1;
        if turns > 30 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    matches!(answer, Answer::Plan { .. })
}

/// Returns all certificates that differ from this one in one place, and some that differ in more.
fn changed(certificate: &NoPlan) -> Vec<NoPlan> {
    let mut all = Vec::new();
    for group in 0..certificate.reached.len() {
        for change in [-1, 1, 3] {
            let mut other = certificate.clone();
            let from = &mut other.reached[group].from.0;
            *from = &*from + &Rational::from(change);
            all.push(other);
        }
        let mut without = certificate.clone();
        without.reached.remove(group);
        all.push(without);
        for fact in 0..certificate.reached[group].facts.len() {
            let mut without = certificate.clone();
            let name = without.reached[group].facts.remove(fact);
            all.push(without.clone());
            let later = &certificate.reached[group].from.0 + &Rational::from(2);
            without.reached.push(elbowroom_verify::no_plan::Group {
                from: Exact(later),
                facts: vec![name],
            });
            all.push(without);
        }
    }
    all
}

#[test]
fn accepted_certificate_agrees_with_reference_and_planner() {
    let mut random = Random(7);
    let (mut proofs, mut plans, mut refused, mut still) = (0, 0, 0, 0);
    for _ in 0..600 {
        let draft = Draft::random(&mut random);
        let (domain, problem) = draft.text();
        let task = task(&domain, &problem);
        let certificate = no_plan_certificate(&task, &listed(&task));
        let is_proof = verify_no_plan(&task, &certificate).is_ok();
        let solvable = has_plan(&task);
        plans += usize::from(solvable);
        proofs += usize::from(is_proof);
        for (number, own) in [certificate.clone()]
            .into_iter()
            .chain(changed(&certificate))
            .enumerate()
        {
            let verdict = verify_no_plan(&task, &own);
            assert!(
                verdict.is_err() || !solvable,
                "{domain}\n{problem}\n{own:?} denies a plan"
            );
            let twin = draft.is_proof(&own);
            if verdict.is_ok() || draft.has_fixed_durations() {
                assert_eq!(
                    verdict.is_ok(),
                    twin,
                    "{domain}\n{problem}\n{own:?}: {verdict:?}"
                );
            }
            if is_proof && number > 0 {
                refused += usize::from(verdict.is_err());
                still += usize::from(verdict.is_ok());
            }
        }
    }
    let enough = proofs > 50 && plans > 50 && refused > 100 && still > 10;
    assert!(enough, "{proofs} {plans} {refused} {still}");
}

const DOOR: &str = "(:requirements :typing :durative-actions :timed-initial-literals)
    (:types place) (:predicates (at ?p - place) (way ?p ?q - place) (open) (in))
    (:functions (length ?p ?q - place))
    (:durative-action go :parameters (?p ?q - place) :duration (= ?duration (length ?p ?q))
      :condition (and (at start (at ?p)) (over all (way ?p ?q)))
      :effect (and (at start (not (at ?p))) (at end (at ?q))))
    (:durative-action enter :parameters () :duration (= ?duration 2)
      :condition (and (at start (at gate)) (over all (open))) :effect (at end (in)))
    (:constants gate - place)";

fn door(closes: u32) -> Task {
    task(
        DOOR,
        &format!(
            "(:objects home bridge - place)
             (:init (at home) (way home bridge) (way bridge gate) (= (length home bridge) 4)
               (= (length bridge gate) 3) (open) (at {closes} (not (open))))
             (:goal (in))"
        ),
    )
}

#[test]
fn certificate_proves_door_unreachable_before_it_closes() {
    let task = door(8);
    let certificate = no_plan_certificate(&task, &listed(&task));
    assert_eq!(verify_no_plan(&task, &certificate), Ok(()));
    let times: Vec<String> = certificate
        .reached
        .iter()
        .map(|own| format!("{}: {}", own.from.0, own.facts.join(" ")))
        .collect();
    assert_eq!(times, ["0: (at home)", "4: (at bridge)", "7: (at gate)"]);
    // The same list proves nothing if the door closes later.
    let later = door(9);
    assert!(matches!(
        verify_no_plan(&later, &certificate),
        Err(NoPlanFlaw::Breach { fact, .. }) if fact == "(in)"
    ));
    let all = no_plan_certificate(&later, &listed(&later));
    assert_eq!(verify_no_plan(&later, &all), Err(NoPlanFlaw::GoalInReach));
    let mut claim = certificate;
    claim.proves = "there is a plan".to_owned();
    assert_eq!(verify_no_plan(&task, &claim), Err(NoPlanFlaw::Claim));
}

#[test]
fn unknown_or_repeated_fact_is_rejected() {
    let task = door(8);
    let certificate = no_plan_certificate(&task, &listed(&task));
    let mut strange = certificate.clone();
    strange.reached[0].facts[0] = "(at nowhere)".to_owned();
    let nowhere = NoPlanFlaw::NoSuchFact("(at nowhere)".to_owned());
    assert_eq!(verify_no_plan(&task, &strange), Err(nowhere));
    let mut twice = certificate;
    twice.reached[1].facts.push("(at home)".to_owned());
    let home = NoPlanFlaw::Twice("(at home)".to_owned());
    assert_eq!(verify_no_plan(&task, &twice), Err(home));
}

/// Two actions that need each other can start at the same time, although neither can start first.
#[test]
fn mutually_dependent_simultaneous_starts_are_reachable() {
    let action = |name: &str, gives: &str, needs: &str| {
        format!(
            "(:durative-action {name} :parameters () :duration (= ?duration 3)
               :condition (over all ({needs}))
               :effect (and (at start ({gives})) (at end (done-{name}))))"
        )
    };
    let domain = format!(
        "(:requirements :durative-actions) (:predicates (p) (q) (done-a) (done-b)) {} {}",
        action("a", "p", "q"),
        action("b", "q", "p")
    );
    let task = task(&domain, "(:init) (:goal (and (done-a) (done-b)))");
    let together = Source::new("plan", "0: (a) [3]\n0: (b) [3]");
    let together = read_plan(&together, &task).unwrap().0;
    assert!(matches!(
        validate(&task, &together, &Strictness::default()),
        Verdict::Valid(_)
    ));
    let none = no_plan_certificate(&task, &ReachedFacts::new());
    assert!(matches!(
        verify_no_plan(&task, &none),
        Err(NoPlanFlaw::Breach { .. })
    ));
}

/// A certificate is never accepted for a solvable problem, with various conditions and effects.
#[test]
fn plans_enabled_by_rules_quantifiers_or_numbers_are_not_denied() {
    let solvable = [
        // A rule, and an existential goal.
        (
            "(:requirements :typing :derived-predicates :negative-preconditions) (:types t)
             (:predicates (p ?x - t) (q ?x - t) (r))
             (:derived (q ?x - t) (and (p ?x) (not (r))))
             (:action a :parameters (?x - t) :effect (p ?x))",
            "(:objects x y - t) (:init) (:goal (exists (?x - t) (q ?x)))",
        ),
        // A conditional effect under a quantifier, and a disjunction.
        (
            "(:requirements :adl) (:types t) (:predicates (p ?x - t) (q ?x - t) (r))
             (:action a :parameters () :precondition (or (r) (forall (?x - t) (p ?x)))
               :effect (forall (?x - t) (when (p ?x) (q ?x))))
             (:action b :parameters (?x - t) :effect (p ?x))",
            "(:objects x y - t) (:init) (:goal (forall (?x - t) (q ?x)))",
        ),
        // Numbers that change, and a duration that is chosen.
        (
            "(:requirements :durative-actions :numeric-fluents :duration-inequalities)
             (:predicates (full)) (:functions (level) (rate))
             (:durative-action fill :parameters () :duration (<= ?duration 9)
               :condition (at end (>= (level) 2)) :effect (and (at end (full))
                 (at start (increase (level) (rate)))))",
            "(:init (= (level) 0) (= (rate) 2)) (:goal (full))",
        ),
        // Facts that timed initials delete and add again.
        (
            "(:requirements :durative-actions :timed-initial-literals) (:predicates (light) (seen))
             (:durative-action look :parameters () :duration (= ?duration 6)
               :condition (over all (light)) :effect (at end (seen)))",
            "(:init (light) (at 2 (not (light))) (at 3 (light)) (at 10 (not (light))))
             (:goal (seen))",
        ),
        // A number that timed initials change, which the goal and the action read.
        (
            "(:requirements :durative-actions :timed-initial-literals :numeric-fluents)
             (:predicates (seen)) (:functions (seeing))
             (:durative-action look :parameters () :duration (= ?duration 6)
               :condition (over all (<= (seeing) 2)) :effect (at end (seen)))",
            "(:init (= (seeing) 4) (at 2 (= (seeing) 1)) (at 5 (= (seeing) 2)) (at 9 (= (seeing) 9)))
             (:goal (and (seen) (>= (seeing) 9)))",
        ),
        // A number that timed initials and an action change.
        (
            "(:requirements :durative-actions :timed-initial-literals :numeric-fluents)
             (:predicates (seen)) (:functions (seeing))
             (:durative-action heat :parameters () :duration (= ?duration 6)
               :condition () :effect (at end (increase (seeing) 5)))",
            "(:init (= (seeing) 1) (at 2 (= (seeing) 4))) (:goal (>= (seeing) 9))",
        ),
    ];
    for (domain, problem) in solvable {
        let task = task(domain, problem);
        assert!(has_plan(&task), "{problem}");
        let certificate = no_plan_certificate(&task, &listed(&task));
        let verdict = verify_no_plan(&task, &certificate);
        assert_eq!(verdict, Err(NoPlanFlaw::GoalInReach), "{problem}");
        for own in changed(&certificate) {
            assert!(verify_no_plan(&task, &own).is_err(), "{own:?}");
        }
    }
}

#[test]
fn number_that_timed_initials_never_raise_enough_is_a_proof() {
    let domain = "(:requirements :durative-actions :timed-initial-literals :numeric-fluents)
        (:predicates (seen)) (:functions (seeing) (limit))
        (:durative-action look :parameters () :duration (= ?duration 6)
          :condition (over all (<= (seeing) (limit))) :effect (at end (seen)))";
    let init = "(= (seeing) 4) (= (limit) 2) (at 2 (= (seeing) 1)) (at 5 (= (seeing) 3)) (at 20 (= (seeing) 4))";
    let is_denied = |goal: &str, init: &str| {
        let task = task(domain, &format!("(:init {init}) (:goal {goal})"));
        let certificate = no_plan_certificate(&task, &listed(&task));
        let is_proof = verify_no_plan(&task, &certificate).is_ok();
        assert!(!is_proof || !has_plan(&task), "{goal}");
        is_proof
    };
    assert!(is_denied("(>= (seeing) 9)", init));
    assert!(is_denied("(not (< (seeing) 9))", init));
    // It holds only before the last timed initial.
    assert!(is_denied("(= (seeing) 3)", init));
    assert!(!is_denied("(= (seeing) 4)", init));
    assert!(!is_denied("(not (= (seeing) 3))", init));
    // The seeing is good enough for 3, and for 15 with another limit.
    assert!(is_denied("(seen)", init));
    assert!(!is_denied(
        "(seen)",
        &init.replace("(limit) 2", "(limit) 3")
    ));
    // It has no value first.
    assert!(!is_denied(
        "(seen)",
        &init
            .replace("(= (seeing) 4) (= (limit)", "(= (limit)")
            .replace("(limit) 2", "(limit) 3")
    ));
}

/// Returns a random problem about a number that timed initials change.
fn numeric_problem(random: &mut Random) -> Task {
    let compare = |random: &mut Random| {
        let comparison = ["<", "<=", "=", ">=", ">"][random.below(5)];
        let text = format!("({comparison} (x) {})", random.below(6));
        if random.below(4) == 0 {
            format!("(not {text})")
        } else {
            text
        }
    };
    let mut domain = "(:requirements :durative-actions :timed-initial-literals :numeric-fluents
        :negative-preconditions) (:predicates (f0) (f1)) (:functions (x))"
        .to_owned();
    for number in 0..2 {
        let duration = random.below(4);
        let when = ["at start", "over all", "at end"][random.below(3)];
        let condition = compare(random);
        let changes = random.below(12) == 0;
        let change = if changes {
            "(at end (increase (x) 1))"
        } else {
            ""
        };
        let other = if number == 1 { "(at start (f0))" } else { "" };
        domain += &format!(
            "(:durative-action a{number} :parameters () :duration (= ?duration {duration})
              :condition (and ({when} {condition}) {other})
              :effect (and (at end (f{number})) {change}))"
        );
    }
    let (mut init, mut time) = (String::new(), 0);
    if random.below(4) > 0 {
        init += &format!("(= (x) {})", random.below(6));
    }
    for _ in 0..random.below(4) {
        time += 1 + random.below(4);
        init += &format!("(at {time} (= (x) {}))", random.below(6));
    }
    let fact = ["", "(f0)", "(f1)"][random.below(3)];
    let number = if random.below(2) == 0 {
        compare(random)
    } else {
        String::new()
    };
    task(
        &domain,
        &format!("(:init {init}) (:goal (and {fact} {number}))"),
    )
}

#[test]
fn proof_by_timed_numbers_agrees_with_planner() {
    let mut random = Random(41);
    let (mut denied, mut solved) = (0, 0);
    for _ in 0..600 {
        let task = numeric_problem(&mut random);
        let certificate = no_plan_certificate(&task, &listed(&task));
        let is_denied = verify_no_plan(&task, &certificate).is_ok();
        let is_solved = has_plan(&task);
        assert!(!(is_denied && is_solved), "{certificate:?}");
        denied += usize::from(is_denied);
        solved += usize::from(is_solved);
    }
    assert!(denied > 100 && solved > 100, "{denied} {solved}");
}
