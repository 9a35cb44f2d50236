//! Simultaneous happenings are one group for the simulated world, for the believed state, and for
//! the validator.

use std::fmt::Write as _;

use elbowroom::execution::run::{Report, Verdict};
use elbowroom::model::validate::{self, ViolationKind, validate};
use elbowroom::num::Rational;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::execution::literal::execute;
use crate::execution::scene::{EXECUTORS, Scene, runs};

fn domain(rest: &str) -> String {
    format!(
        "(define (domain d) (:requirements :durative-actions :fluents :negative-preconditions
            :timed-initial-literals :continuous-effects :conditional-effects
            :duration-inequalities)
         (:predicates (p0) (p1) (p2) (p3)) (:functions (x) (y)) {rest})"
    )
}

fn scene(actions: &str, init: &str, goal: &str, plan: &str) -> Scene {
    let problem =
        format!("(define (problem p) (:domain d) (:init (= (x) 0) {init}) (:goal {goal}))");
    Scene::new(&domain(actions), &problem, Some(plan))
}

fn reaches_the_goal(scene: &Scene) {
    let outcome = execute(scene);
    assert_eq!(
        outcome.report.verdict,
        Verdict::GoalReached,
        "{:#?}",
        outcome.report.executed
    );
    assert!(outcome.is_goal);
    let verdict = scene.judged(&outcome.report);
    assert!(verdict.is_valid(), "{verdict:?}");
}

/// Checks that every executor reaches the goal by a valid plan without deviations.
fn every_execution_is_valid(scene: &Scene) {
    for executor in EXECUTORS.iter() {
        let report = scene.run(executor, &scene.world(""), 0);
        assert_eq!(report.verdict, Verdict::GoalReached, "{executor}");
        let verdict = scene.judged(&report);
        assert!(verdict.is_valid(), "{executor}: {verdict:?}");
    }
}

/// Checks that the plan is invalid, so that nothing was started.
fn is_refused(report: &Report) {
    let Verdict::NoPlan { why, .. } = &report.verdict else {
        panic!("{report:#?}");
    };
    assert!(why.starts_with("the plan is not valid"), "{why}");
    assert_eq!(report.starts, 0);
}

#[test]
fn starts_writing_the_same_number_are_separated() {
    let up = "(:action up :parameters () :precondition () :effect (assign (x) (+ (x) 1)))";
    every_execution_is_valid(&scene(up, "", "(>= (x) 2)", "0: (up)\n1: (up)"));
}

#[test]
fn start_is_separated_from_late_end() {
    let actions = "
        (:durative-action set :parameters () :duration (= ?duration 1) :condition ()
          :effect (at end (p0)))
        (:durative-action clear :parameters () :duration (= ?duration 1) :condition ()
          :effect (and (at start (not (p0))) (at end (p1))))";
    let plan = "0: (set) [1]\n0.5: (clear) [1]\n3: (set) [1]";
    let scene = scene(actions, "", "(and (p0) (p1))", plan);
    let late = scene.world("[[delay]]\naction = \"*\"\nuniform = { from = 0, to = 0.5 }\n");
    for executor in EXECUTORS.iter() {
        for seed in 0..20 {
            // Each execution is validated.
            scene.run(executor, &late, seed);
        }
    }
}

#[test]
fn planned_end_is_separated_from_interfering_happenings() {
    let two_ends = "
        (:durative-action add :parameters () :duration (= ?duration 6) :condition ()
          :effect (and (at end (p0)) (at end (p1))))
        (:durative-action delete :parameters () :duration (= ?duration 6) :condition ()
          :effect (and (at end (not (p0))) (at end (p2))))";
    let open = "
        (:durative-action add :parameters () :duration (>= ?duration 0) :condition ()
          :effect (at end (p0)))
        (:durative-action rest :parameters () :duration (>= ?duration 0) :condition () :effect ())";
    let timed = "(at 0.5 (not (p0)))";
    for (actions, init, goal, plan) in [
        (
            two_ends,
            "",
            "(and (p0) (p1) (p2))",
            "0.001: (add) [6]\n0: (delete) [6]",
        ),
        (open, timed, "(p0)", "5: (rest) [10]\n5: (add) [0.5]"),
    ] {
        every_execution_is_valid(&scene(actions, init, goal, plan));
    }
}

#[test]
fn useless_instantaneous_action_is_not_repeated_forever() {
    let actions = "
        (:durative-action light :parameters () :duration (>= ?duration 0) :condition ()
          :effect (at start (p0)))
        (:durative-action add :parameters () :duration (>= ?duration 0) :condition ()
          :effect (at start (increase (x) 1)))";
    let plan = "1: (add) [0]\n1: (light) [3]\n3.001: (add) [0]\n5.003: (add) [0]";
    let scene = scene(actions, "", "(and (p0) (> (x) 2))", plan);
    for executor in EXECUTORS.iter() {
        let report = scene.run(executor, &scene.world(""), 0);
        assert_eq!(report.verdict, Verdict::GoalReached, "{executor}");
        assert!(report.starts < 200, "{executor}: {} starts", report.starts);
    }
}

const MATCH: &str = "
    (:durative-action light :parameters () :duration (= ?duration 8) :condition (at start (p3))
      :effect (and (at start (p0)) (at end (not (p0)))))
    (:durative-action mend :parameters () :duration (= ?duration 5)
      :condition (over all (p0)) :effect (at end (p1)))";

#[test]
fn match_burning_until_the_end_of_mending_suffices() {
    let plan = "0: (light) [8]\n3: (mend) [5]";
    reaches_the_goal(&scene(MATCH, "(p3)", "(p1)", plan));
    // For any order of the starts.
    let short = MATCH.replace("?duration 8", "?duration 2");
    let plan = "0: (light) [2]\n0.5: (mend) [1.5]";
    let short = short.replace("?duration 5", "?duration 1.5");
    reaches_the_goal(&scene(&short, "(p3)", "(p1)", plan));
}

#[test]
fn match_burning_out_before_the_end_of_mending_fails() {
    let outcome = execute(&scene(
        MATCH,
        "(p3)",
        "(p1)",
        "0: (light) [8]\n3.001: (mend) [5]",
    ));
    is_refused(&outcome.report);
}

#[test]
fn a_strict_comparison_may_become_an_equality_at_the_end() {
    let drain = "(:durative-action drain :parameters () :duration (>= ?duration 0)
        :condition (over all (> (x) 0))
        :effect (and (decrease (x) (* #t 2)) (at end (p0))))";
    reaches_the_goal(&scene(
        &drain.replace("(> (x) 0)", "(> (+ (x) 10) 0)"),
        "",
        "(p0)",
        "0: (drain) [5]",
    ));
    // With one more tick, it fails.
    let late = scene(
        &drain.replace("(> (x) 0)", "(> (+ (x) 10) 0)"),
        "",
        "(p0)",
        "0: (drain) [5.001]",
    );
    assert_ne!(execute(&late).report.verdict, Verdict::GoalReached);
}

/// A violation during continuous changes is detected at the next multiple of the resolution,
/// independent of the executor's observations.
#[test]
fn temporary_bound_violation_is_detected() {
    let actions = "
        (:durative-action dive :parameters () :duration (= ?duration 10)
          :condition (over all (>= (x) -3)) :effect (and (decrease (x) (* #t 1)) (at end (p0))))
        (:durative-action rise :parameters () :duration (= ?duration 10)
          :condition () :effect (increase (x) (* #t (y))))
        (:durative-action push :parameters () :duration (= ?duration 8)
          :condition () :effect (increase (y) (* #t 1)))";
    // With a = 1 - y: x = -a until 1, and -a - a s + s²/2 at 1 + s; least at s = a.
    let plan = "0: (dive) [10]\n0: (rise) [10]\n1: (push) [8]";
    reaches_the_goal(&scene(actions, "(= (y) -0.6)", "(p0)", plan));
    let deep = execute(&scene(actions, "(= (y) -1)", "(p0)", plan));
    // -3 is reached at s = 2 - √2.
    is_refused(&deep.report);
}

#[test]
fn an_action_of_duration_0_takes_no_time() {
    let blink = "(:durative-action blink :parameters () :duration (= ?duration 0)
        :condition (at start (p3)) :effect (and (at start (p0)) (at end (p1))))";
    let scene = scene(blink, "(p3)", "(and (p0) (p1))", "2: (blink) [0]");
    reaches_the_goal(&scene);
    let executed = execute(&scene).report.executed;
    assert_eq!(executed[0].step.duration, Some(Rational::ZERO));
    assert_eq!(executed[0].step.start, Rational::from(2));
}

/// One end increases what the other decreases; neither reads it.
#[test]
fn simultaneous_ends_and_start_are_one_happening() {
    let actions = "
        (:durative-action give :parameters () :duration (= ?duration 2)
          :condition () :effect (at end (increase (x) 1)))
        (:durative-action take :parameters () :duration (= ?duration 2)
          :condition () :effect (at end (decrease (x) 1)))
        (:durative-action lend :parameters () :duration (= ?duration 1)
          :condition () :effect (and (at start (decrease (x) 1)) (at end (increase (x) 1))))
        (:durative-action watch :parameters () :duration (= ?duration 5)
          :condition (over all (>= (x) 0)) :effect (at end (p0)))";
    for plan in [
        "0: (watch) [5]\n1: (take) [2]\n1: (give) [2]",
        "0: (watch) [5]\n1: (give) [2]\n1: (take) [2]",
        // The start at 3 consumes what the end at 3 produces.
        "0: (watch) [5]\n1: (give) [2]\n3: (lend) [1]",
    ] {
        reaches_the_goal(&scene(actions, "", "(p0)", plan));
    }
    let outcome = execute(&scene(
        actions,
        "",
        "(p0)",
        "0: (watch) [5]\n1: (take) [2]\n2: (give) [2]",
    ));
    is_refused(&outcome.report);
}

/// Timed initials belong to the group of their time.
#[test]
fn timed_initial_may_coincide_with_end_and_start() {
    let actions = "
        (:durative-action pass :parameters () :duration (= ?duration 2)
          :condition (over all (p0)) :effect (at end (p1)))
        (:durative-action follow :parameters () :duration (= ?duration 2)
          :condition (over all (not (p0))) :effect (at end (p2)))";
    let plan = "1: (pass) [2]\n3: (follow) [2]";
    let init = "(at 1 (p0)) (at 3 (not (p0)))";
    reaches_the_goal(&scene(actions, init, "(and (p1) (p2))", plan));
    let early = "0.999: (pass) [2]\n3: (follow) [2]";
    let outcome = execute(&scene(actions, init, "(and (p1) (p2))", early));
    assert_ne!(outcome.report.verdict, Verdict::GoalReached);
}

/// Random conditions, effects and plans, on a grid so coarse that most happenings coincide.
#[test]
fn worlds_and_beliefs_agree_with_validator_on_random_plans() {
    let (mut valid, mut whole, mut invalid) = (0, 0, 0);
    for seed in 0..runs("ELBOWROOM_ONE_TIME_PLANS", 4000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (domain, problem, plan) = random_problem(&mut rng);
        let scene = Scene::new(&domain, &problem, Some(&plan));
        let verdict = validate(&scene.task, &scene.plan, &validate::Settings::default());
        let about = || format!("{seed}\n{domain}\n{problem}\n{plan}\n{verdict:?}");
        match &verdict {
            validate::Verdict::Valid(judged) => {
                valid += 1;
                let outcome = execute(&scene);
                let report = &outcome.report;
                assert_eq!(report.verdict, Verdict::GoalReached, "{}", about());
                // The run ends when no further timed initial affects the goal. The validator
                // reports the state after all of them.
                let timed = scene.task.timed();
                if timed.iter().all(|it| it.time <= judged.makespan) {
                    whole += 1;
                    assert_eq!(outcome.truth, judged.state, "{}", about());
                    assert_eq!(outcome.belief.as_ref(), Some(&judged.state), "{}", about());
                    assert_eq!(report.time, judged.makespan, "{}", about());
                } else {
                    assert!(report.time >= judged.makespan, "{}", about());
                }
                let again = scene.judged(report);
                assert!(again.is_valid(), "{}\n{again:?}", about());
            }
            validate::Verdict::Invalid(violation) => {
                // Worlds do not check separations.
                if matches!(violation.kind, ViolationKind::Condition { .. }) {
                    invalid += 1;
                    let outcome = execute(&scene);
                    // The goal may still hold.
                    let is_done = outcome.belief.is_some();
                    let is_reached = outcome.report.verdict == Verdict::GoalReached;
                    assert!(!(is_done && is_reached), "{}", about());
                }
            }
            validate::Verdict::Undecided(_) => {}
        }
    }
    assert!(
        whole > 200 && valid > 300 && invalid > 300,
        "{whole} of {valid}, {invalid}"
    );
}

fn pick<'a>(rng: &mut ChaCha8Rng, among: &[&'a str]) -> &'a str {
    among[rng.random_range(0..among.len())]
}

fn condition(rng: &mut ChaCha8Rng) -> String {
    let fact = pick(rng, &["(p0)", "(p1)", "(p2)", "(p3)"]);
    let number = rng.random_range(-2..4);
    match rng.random_range(0..10) {
        0..4 => fact.to_owned(),
        4..6 => format!("(not {fact})"),
        6 => format!("(or {fact} (> (x) {number}))"),
        7 => format!("(> (x) {number})"),
        8 => format!("(<= (x) {number})"),
        _ => format!("(>= (+ (x) (y)) {number})"),
    }
}

fn change(rng: &mut ChaCha8Rng) -> String {
    let fact = pick(rng, &["(p0)", "(p1)", "(p2)", "(p3)"]);
    match rng.random_range(0..9) {
        0..3 => fact.to_owned(),
        3..5 => format!("(not {fact})"),
        5 => "(increase (x) 1)".to_owned(),
        6 => "(decrease (x) ?duration)".to_owned(),
        7 => "(increase (x) (y))".to_owned(),
        _ => "(assign (y) 2)".to_owned(),
    }
}

fn random_problem(rng: &mut ChaCha8Rng) -> (String, String, String) {
    let mut actions = String::new();
    for index in 0..4 {
        let mut conditions = String::new();
        for when in ["at start", "over all", "at end"] {
            if rng.random_range(0..3) == 0 {
                let _ = write!(conditions, " ({when} {})", condition(rng));
            }
        }
        let mut effects = String::new();
        for when in ["at start", "at end"] {
            if rng.random_range(0..3) > 0 {
                let _ = write!(effects, " ({when} {})", change(rng));
            }
        }
        if rng.random_range(0..5) == 0 {
            let when = pick(rng, &["at start", "over all", "at end"]);
            let (needed, change) = (condition(rng), change(rng));
            let _ = write!(effects, " (when ({when} {needed}) (at end {change}))");
        }
        match rng.random_range(0..6) {
            0 => effects.push_str(" (increase (x) (* #t 1))"),
            1 => effects.push_str(" (decrease (x) (* #t (y)))"),
            2 => effects.push_str(" (increase (y) (* #t 1))"),
            _ => {}
        }
        let _ = write!(
            actions,
            "(:durative-action a{index} :parameters () :duration (>= ?duration 0)
               :condition (and{conditions}) :effect (and{effects}))"
        );
    }
    let mut init = String::from("(= (x) 1) (= (y) 1)");
    for fact in ["(p0)", "(p1)", "(p2)", "(p3)"] {
        if rng.random_bool(0.5) {
            init.push_str(fact);
        }
        if rng.random_bool(0.2) {
            let literal = if rng.random_bool(0.5) {
                fact.to_owned()
            } else {
                format!("(not {fact})")
            };
            let _ = write!(init, "(at {} {literal})", rng.random_range(1..6));
        }
    }
    let goal = condition(rng);
    let problem = format!("(define (problem p) (:domain d) (:init {init}) (:goal (and {goal})))");
    let mut plan = String::new();
    for _ in 0..rng.random_range(1..5) {
        let half = |n: i64| f64::from(i32::try_from(n).expect("small")) / 2.0;
        let start = half(rng.random_range(0..8));
        let duration = half(rng.random_range(0..7));
        let _ = writeln!(plan, "{start}: (a{}) [{duration}]", rng.random_range(0..4));
    }
    (domain(&actions), problem, plan)
}
