//! Rounding rule for plans, and plans written for other tools.

use std::fmt::Write as _;

use elbowroom::model::validate::{Settings, validate};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_plan, read_problem};
use elbowroom::{RoundingRule, plan_text};
use proptest::prelude::*;

fn task(domain: &str, problem: &str) -> Task {
    let (problem, _) = read_problem(
        &Source::new("domain", domain),
        &Source::new("problem", problem),
    )
    .unwrap_or_else(|wrong| panic!("{wrong}"));
    Task::new(problem)
}

/// Returns a task with a guard that moves for `time`, then watches for 2 to 10. Meanwhile a lamp
/// may shine, which drains its battery by 3 a second.
fn guard(time: &str, charge: &str) -> Task {
    let domain = "
        (define (domain guard)
          (:requirements :typing :durative-actions :fluents :continuous-effects
                         :duration-inequalities)
          (:predicates (here) (there) (watched) (lit))
          (:functions (time) (charge))
          (:durative-action move :parameters () :duration (= ?duration (time))
            :condition (at start (here))
            :effect (and (at start (not (here))) (at end (there))))
          (:durative-action watch :parameters ()
            :duration (and (>= ?duration 2) (<= ?duration 10))
            :condition (at start (there)) :effect (at end (watched)))
          (:durative-action shine :parameters ()
            :duration (and (>= ?duration 1) (<= ?duration 10))
            :condition (over all (>= (charge) 0))
            :effect (and (decrease (charge) (* #t 3)) (at end (lit)))))";
    let problem = format!(
        "(define (problem one) (:domain guard)
           (:init (here) (= (time) {time}) (= (charge) {charge}))
           (:goal (watched)))"
    );
    task(domain, &problem)
}

/// Returns the plan as the rule reads it, and the number of warnings.
fn meant(task: &Task, text: &str, tolerance: Option<&str>) -> (TimeTriggeredPlan, usize) {
    let tolerance = tolerance.map(|text| text.parse().expect("a number"));
    let rule = RoundingRule::with_tolerance(tolerance);
    let (plan, warnings) = rule
        .read_plan(&Source::new("plan", text), task)
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    (plan, warnings.len())
}

fn is_valid(task: &Task, plan: &TimeTriggeredPlan) -> bool {
    validate(task, plan, &Settings::default()).is_valid()
}

fn is_accepted(task: &Task, text: &str) -> bool {
    is_valid(task, &meant(task, text, None).0)
}

#[test]
fn numbers_within_one_unit_of_the_last_digit_are_accepted_and_others_are_not() {
    let task = guard("5", "1");
    for (text, expected) in [
        ("0: (move) [5]\n5.001: (watch) [2]", true),
        ("0: (move) [5.0001]\n5.001: (watch) [2]", true),
        ("0: (move) [4.9999]\n5.001: (watch) [2]", true),
        ("0.000: (move) [5.001]\n5.001: (watch) [2.000]", true),
        ("0.000: (move) [4.999]\n5.001: (watch) [1.999]", true),
        ("0: (move) [5]\n5.0006: (watch) [2]", false),
        ("0: (move) [5]\n5.0009: (watch) [2]", true),
        ("0: (move) [50]\n50.001: (watch) [2]", false),
        ("0: (move) [1]\n5.001: (watch) [2]", false),
        ("0: (move) [5.002]\n5.003: (watch) [2]", false),
        ("0: (move) [4.9998]\n5.001: (watch) [2]", false),
        ("0: (move) [4.99]\n5.001: (watch) [2]", false),
        ("0: (move) [5]\n5.001: (watch) [0.5]", false),
        ("0: (move) [5]\n5.001: (watch) [1.9998]", false),
        // A fraction is exact.
        ("0: (move) [50001/10000]\n5.001: (watch) [2]", false),
        // Simultaneous happenings that interfere have no order.
        ("0: (move) [5]\n5: (watch) [2]", false),
        ("0: (move) [5]\n3: (watch) [2]", false),
        ("5.001: (move) [5]\n0: (watch) [2]", false),
    ] {
        assert_eq!(is_accepted(&task, text), expected, "{text}");
    }
}

#[test]
fn accepted_plan_has_durations_of_domain_and_differs_from_text_by_rounding_only() {
    let task = guard("10/3", "1");
    for (text, start) in [
        ("0.000: (move) [3.333]\n3.335: (watch) [2.000]", "667/200"),
        // Truncation removes the separation of 0.001.
        (
            "0.000: (move) [3.333]\n3.334: (watch) [2.000]",
            "13003/3000",
        ),
        (
            "0: (move) [3.3333333333333335]\n3.335: (watch) [2]",
            "667/200",
        ),
        ("0: (move) [3.3333333333333]\n3.335: (watch) [2]", "667/200"),
    ] {
        let (plan, warnings) = meant(&task, text, None);
        assert_eq!(warnings, 1, "{text}");
        assert!(is_valid(&task, &plan), "{text}");
        assert_eq!(plan.steps[0].duration, Some(Rational::new(10, 3)), "{text}");
        let printed = read_plan(&Source::new("plan", text), &task)
            .expect("a plan")
            .0;
        let moved = (&plan.steps[1].start - &printed.steps[1].start).abs();
        assert!(moved <= Rational::new(1, 1000), "{text}");
        if start == "667/200" {
            assert_eq!(plan.steps[1].start.to_string(), start, "{text}");
        } else {
            assert!(plan.steps[1].start > printed.steps[1].start, "{text}");
        }
    }
    assert!(!is_accepted(
        &task,
        "0: (move) [3.33333]\n3.3335: (watch) [2]"
    ));
}

#[test]
fn tolerance_replaces_the_printed_digits() {
    let task = guard("5", "1");
    let accepted = |text, tolerance| is_valid(&task, &meant(&task, text, Some(tolerance)).0);
    let text = "0: (move) [5.01]\n5.011: (watch) [2]";
    assert!(!is_accepted(&task, text));
    assert!(accepted(text, "0.01"));
    assert!(!accepted(text, "0.009"));
    let rounded = "0: (move) [4.9999]\n5.001: (watch) [2]";
    assert!(!accepted(rounded, "0"));
    assert!(accepted(rounded, "0.0001"));
    // A valid plan is used as printed.
    let exact = "0: (move) [5]\n5.001: (watch) [2]";
    assert!(accepted(exact, "0"));
    let (plan, warnings) = meant(&task, exact, Some("3"));
    assert_eq!(warnings, 0);
    let printed = read_plan(&Source::new("plan", exact), &task)
        .expect("a plan")
        .0;
    assert_eq!(plan, printed);
}

#[test]
fn numeric_condition_at_its_limit_is_met_within_rounding() {
    // The charge lasts for 10/3 s.
    let task = guard("5", "10");
    let plan = |shine: &str| format!("0: (shine) [{shine}]\n0: (move) [5]\n5.001: (watch) [2]");
    assert!(is_accepted(&task, &plan("3.333")));
    assert!(is_accepted(&task, &plan("3.334")));
    assert!(is_accepted(&task, &plan("3.3333333333333335")));
    assert!(!is_accepted(&task, &plan("3.335")));
    assert!(!is_accepted(&task, &plan("3.3335")));
}

#[test]
fn state_dependent_duration_is_read_from_the_state() {
    let domain = "
        (define (domain tank)
          (:requirements :durative-actions :fluents :continuous-effects :duration-inequalities)
          (:predicates (done) (filled))
          (:functions (level))
          (:durative-action fill :parameters ()
            :duration (and (>= ?duration 1) (<= ?duration 9))
            :condition (at start (>= (level) 0))
            :effect (and (increase (level) (* #t 2)) (at end (filled))))
          (:durative-action pump :parameters () :duration (= ?duration (/ (level) 3))
            :condition (at start (filled)) :effect (at end (done))))";
    let problem = "
        (define (problem one) (:domain tank) (:init (= (level) 0)) (:goal (done)))";
    let task = task(domain, problem);
    // (pump) takes 2/3 x 2.5.
    assert!(is_accepted(&task, "0: (fill) [2.5]\n3: (pump) [1.667]"));
    assert!(is_accepted(&task, "0: (fill) [2.5]\n3: (pump) [1.666]"));
    assert!(!is_accepted(&task, "0: (fill) [2.5]\n3: (pump) [1.65]"));
}

#[test]
fn plan_is_written_in_decimals() {
    let task = guard("10/3", "1");
    let plan = |text: &str| {
        read_plan(&Source::new("plan", text), &task)
            .expect("a plan")
            .0
    };
    let valid = plan("0: (move) [10/3]\n13003/3000: (watch) [2]");
    assert_eq!(
        plan_text(&task, &valid),
        "0.000: (move) [3.333]\n4.334: (watch) [2.000]\n"
    );
    // Finite decimals are preserved.
    let task = guard("3.33334", "1");
    let finite = plan("0: (move) [3.33334]\n3.33434: (watch) [2]");
    assert_eq!(
        plan_text(&task, &finite),
        "0.000: (move) [3.33334]\n3.33434: (watch) [2.000]\n"
    );
    // Rounding never makes an invalid plan valid.
    let invalid = plan("0: (move) [10/3]\n1: (watch) [2]");
    assert!(plan_text(&task, &invalid).contains("[10/3]"));
}

#[test]
fn strict_condition_needs_more_digits() {
    let domain = "
        (define (domain heat)
          (:requirements :durative-actions :fluents :continuous-effects :duration-inequalities)
          (:predicates (hot))
          (:functions (heat))
          (:durative-action burn :parameters ()
            :duration (and (>= ?duration 1) (<= ?duration 9))
            :condition (and (over all (<= (heat) 100000)) (at end (>= (heat) 99999.9)))
            :effect (and (increase (heat) (* #t 30000)) (at end (hot)))))";
    let problem = "
        (define (problem one) (:domain heat) (:init (= (heat) 0)) (:goal (hot)))";
    let task = task(domain, problem);
    let source = Source::new("plan", "0: (burn) [10/3]");
    let plan = read_plan(&source, &task).expect("a plan").0;
    assert!(is_valid(&task, &plan));
    let text = plan_text(&task, &plan);
    assert!(!text.contains('/'), "{text}");
    assert!(is_accepted(&task, &text), "{text}");
    let read = read_plan(&Source::new("plan", text.clone()), &task)
        .expect("a plan")
        .0;
    let like_val = Settings::like_val(Rational::new(1, 1000));
    assert!(validate(&task, &read, &like_val).is_valid(), "{text}");
}

/// Returns a sequence of jobs, 0.001 apart, and its plan: job `index` has `parts` to make at
/// `speed`.
fn chain(jobs: &[(i64, i64)]) -> (Task, String) {
    let domain = "
        (define (domain chain)
          (:requirements :typing :durative-actions :fluents)
          (:types job)
          (:predicates (next ?a ?b - job) (ready ?a - job) (done ?a - job))
          (:functions (parts ?a - job) (speed ?a - job))
          (:durative-action work :parameters (?a ?b - job)
            :duration (= ?duration (/ (parts ?a) (speed ?a)))
            :condition (and (at start (ready ?a)) (over all (next ?a ?b)))
            :effect (and (at start (not (ready ?a))) (at end (ready ?b)) (at end (done ?a)))))";
    let (mut init, mut goal, mut plan) = (String::new(), String::new(), String::new());
    let mut names = String::from("j0");
    let mut now = Rational::ZERO;
    for (index, (parts, speed)) in jobs.iter().enumerate() {
        let (duration, next) = (Rational::new(*parts, *speed), index + 1);
        let _ = write!(
            init,
            "(next j{index} j{next}) (= (parts j{index}) {parts}) (= (speed j{index}) {speed}) "
        );
        let _ = write!(goal, "(done j{index}) ");
        let _ = write!(names, " j{next}");
        let _ = writeln!(plan, "{now}: (work j{index} j{next}) [{duration}]");
        now = now + duration + Rational::new(1, 1000);
    }
    let problem = format!(
        "(define (problem one) (:domain chain) (:objects {names} - job)
           (:init (ready j0) {init}) (:goal (and {goal})))"
    );
    (task(domain, &problem), plan)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn written_plan_is_read_as_valid_and_has_no_fractions(
        durations in prop::collection::vec((1_i64..2_000, 1_i64..60), 1..9)
    ) {
        let (task, text) = chain(&durations);
        let plan = read_plan(&Source::new("plan", text), &task).expect("a plan").0;
        prop_assert!(is_valid(&task, &plan));
        let written = plan_text(&task, &plan);
        prop_assert!(!written.contains('/'), "{}", written);
        prop_assert!(is_accepted(&task, &written), "{}", written);
        let read = read_plan(&Source::new("plan", written.clone()), &task).expect("a plan").0;
        let like_val = Settings::like_val(Rational::new(1, 1000));
        prop_assert!(validate(&task, &read, &like_val).is_valid(), "{}", written);
        for (one, other) in plan.steps.iter().zip(&read.steps) {
            prop_assert!((&one.start - &other.start).abs() <= Rational::new(1, 2000));
        }
    }

    #[test]
    fn truncated_or_rounded_plan_is_accepted(
        durations in prop::collection::vec((1_i64..2_000, 1_i64..60), 1..9),
        digits in 3_u32..8,
        truncates in any::<bool>(),
    ) {
        let (task, text) = chain(&durations);
        let plan = read_plan(&Source::new("plan", text), &task).expect("a plan").0;
        let scale = Rational::from(10_i64.pow(digits));
        let printed = |value: &Rational| {
            let half = if truncates { Rational::ZERO } else { Rational::new(1, 2) };
            let digits = usize::try_from(digits).expect("few");
            let units = (value * &scale + half).floor().to_string();
            let padded = format!("{units:0>width$}", width = digits + 1);
            let (whole, part) = padded.split_at(padded.len() - digits);
            format!("{whole}.{part}")
        };
        let mut rounded = String::new();
        for step in &plan.steps {
            let duration = step.duration.as_ref().expect("durative");
            let _ = writeln!(
                rounded,
                "{}: {} [{}]",
                printed(&step.start), step.action.name, printed(duration)
            );
        }
        prop_assert!(is_accepted(&task, &rounded), "{}", rounded);
    }
}
