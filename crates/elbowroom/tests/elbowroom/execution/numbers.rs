//! Executors start actions only if conditions on numbers and duration bounds hold. The validator
//! checks each run ([`Scene::run`]).

use std::fmt::Write as _;

use elbowroom::execution::run::Verdict;
use elbowroom::model::validate::{self, Settings, validate};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::execution::scene::{Scene, runs};

/// Executors that order a plan's actions by facts, and check numbers at the starts.
const EXECUTORS: [&str; 3] = ["adaptable", "lookahead", "fixed:10"];

/// Those of them that choose orders.
const BY_ORDERS: [&str; 2] = ["adaptable", "lookahead"];

fn scene(actions: &str, initial: &str, goal: &str, plan: &str) -> Scene {
    let domain = format!(
        "(define (domain d) (:requirements :durative-actions :numeric-fluents)
           (:predicates (p) (q) (r)) (:functions (n) (m) (u)) {actions})"
    );
    let problem = format!(
        "(define (problem x) (:domain d) (:init (= (n) 0) (= (m) 3) {initial}) (:goal (and {goal})))"
    );
    Scene::new(&domain, &problem, Some(plan))
}

/// Returns the start times of the actions in a run that reached its goal without replanning.
fn starts(scene: &Scene, executor: &str) -> Vec<(String, String)> {
    let report = scene.run(executor, &scene.world(""), 1);
    assert_eq!(
        report.verdict,
        Verdict::GoalReached,
        "{executor}: {report:#?}"
    );
    assert_eq!(report.replans, 0, "{executor}: {report:#?}");
    let steps = report.executed.iter().map(|executed| &executed.step);
    let start =
        |step: &elbowroom::model::Step| (step.action.name.clone(), step.start.to_decimal(3));
    steps.map(start).collect()
}

fn owned<const N: usize>(starts: [(&str, &str); N]) -> Vec<(String, String)> {
    let owned = |(name, time): (&str, &str)| (name.to_owned(), time.to_owned());
    starts.map(owned).to_vec()
}

#[test]
fn start_awaits_number_that_grows() {
    let scene = scene(
        "(:durative-action fill :parameters () :duration (= ?duration 10)
           :effect (and (at end (p)) (increase (n) (* #t 0.5))))
         (:durative-action pour :parameters () :duration (= ?duration 1)
           :condition (at start (>= (n) 2)) :effect (at end (q)))",
        "",
        "(p) (q)",
        "0: (fill) [10]\n6: (pour) [1]",
    );
    for executor in BY_ORDERS {
        let expected = owned([("(fill)", "0"), ("(pour)", "4")]);
        assert_eq!(starts(&scene, executor), expected, "{executor}");
    }
}

#[test]
fn start_awaits_timed_initial_fluent() {
    let scene = scene(
        "(:durative-action pour :parameters () :duration (= ?duration 1)
           :condition (at start (>= (n) 2)) :effect (at end (q)))",
        "(at 4 (= (n) 2))",
        "(q)",
        "6: (pour) [1]",
    );
    for executor in BY_ORDERS {
        let expected = owned([("(pour)", "4.001")]);
        assert_eq!(starts(&scene, executor), expected, "{executor}");
    }
}

#[test]
fn durations_that_read_changed_numbers_are_executed() {
    let scene = scene(
        "(:durative-action load :parameters () :duration (= ?duration 2)
           :effect (and (at end (p)) (at end (increase (m) 4))))
         (:durative-action drive :parameters () :duration (= ?duration (m)) :effect (at end (q)))",
        "",
        "(p) (q)",
        "0: (load) [2]\n3: (drive) [7]",
    );
    for executor in EXECUTORS {
        let expected = owned([("(load)", "0"), ("(drive)", "2.001")]);
        assert_eq!(starts(&scene, executor), expected, "{executor}");
    }
}

#[test]
fn durations_are_chosen_again_after_external_change() {
    for bound in [
        "(= ?duration (m))",
        "(>= ?duration (m))",
        "(= ?duration (+ (m) 2))",
    ] {
        let actions = format!(
            "(:durative-action load :parameters () :duration (= ?duration 4) :effect (at end (p)))
             (:durative-action drive :parameters () :duration {bound}
               :condition (at start (p)) :effect (at end (q)))"
        );
        let planned = if bound.contains('+') { 5 } else { 3 };
        let plan = format!("0: (load) [4]\n4.001: (drive) [{planned}]");
        let scene = scene(&actions, "", "(q)", &plan);
        for executor in ["live", "guarded", "stn", "esterel", "adaptable"] {
            let world = scene.world("[[event]]\nfluent = \"(m)\"\nbecomes = 8\nconstant = 2\n");
            let report = scene.run(executor, &world, 1);
            assert_eq!(report.verdict, Verdict::GoalReached, "{bound}, {executor}");
        }
    }
}

#[test]
fn open_duration_read_by_start_stays_as_planned() {
    let scene = scene(
        "(:durative-action melt :parameters () :duration (and (>= ?duration 1) (<= ?duration 10))
           :condition (at start (>= ?duration 9)) :effect (at end (q)))",
        "",
        "(q)",
        "0: (melt) [10]",
    );
    assert_eq!(starts(&scene, "live"), owned([("(melt)", "0")]));
}

#[test]
fn open_duration_read_by_other_duration_stays_as_planned() {
    let scene = scene(
        "(:durative-action grow :parameters () :duration (and (>= ?duration 2) (<= ?duration 10))
           :effect (and (at end (p)) (at end (increase (n) ?duration))))
         (:durative-action cut :parameters () :duration (= ?duration (n))
           :condition (at start (p)) :effect (at end (q)))",
        "",
        "(q)",
        "0: (grow) [2]\n2.001: (cut) [2]",
    );
    let expected = owned([("(grow)", "0"), ("(cut)", "2.001")]);
    assert_eq!(starts(&scene, "live"), expected);
}

#[test]
fn duration_bound_awaits_number_that_grows() {
    let scene = scene(
        "(:durative-action fill :parameters () :duration (= ?duration 10)
           :effect (and (at end (p)) (increase (n) (* #t 1))))
         (:durative-action drive :parameters () :duration (<= ?duration (n)) :effect (at end (q)))",
        "",
        "(p) (q)",
        "0: (fill) [10]\n5: (drive) [2.5]",
    );
    for executor in BY_ORDERS {
        let expected = owned([("(fill)", "0"), ("(drive)", "2.5")]);
        assert_eq!(starts(&scene, executor), expected, "{executor}");
    }
}

#[test]
fn comparison_of_undefined_fluent_does_not_hold() {
    let scene = scene(
        "(:durative-action heat :parameters () :duration (= ?duration 3) :effect (at end (p)))
         (:durative-action pour :parameters () :duration (= ?duration 1)
           :condition (at start (or (p) (> (u) 3))) :effect (at end (q)))",
        "",
        "(q)",
        "0: (heat) [3]\n4: (pour) [1]",
    );
    for executor in BY_ORDERS {
        let expected = owned([("(heat)", "0"), ("(pour)", "3.001")]);
        assert_eq!(starts(&scene, executor), expected, "{executor}");
    }
}

/// Action of a random problem.
struct Draft {
    duration: String,
    effects: String,
    /// Conditions with their time specifiers.
    conditions: Vec<String>,
    step: String,
}

const FLUENTS: [&str; 3] = ["(n)", "(m)", "(k)"];

fn pick<'a>(rng: &mut ChaCha8Rng, from: &[&'a str]) -> &'a str {
    from.choose(rng).expect("something to choose from")
}

/// Returns a comparison that may hold.
fn comparison(rng: &mut ChaCha8Rng) -> String {
    let left = pick(rng, &FLUENTS);
    let right = match rng.random_range(0..5) {
        0 => pick(rng, &FLUENTS).to_owned(),
        _ => rng.random_range(-2..10).to_string(),
    };
    let own = format!("({} {left} {right})", pick(rng, &[">=", "<=", "<", ">"]));
    match rng.random_range(0..8) {
        0 => format!("(or {own} (> (u) 3))"),
        1 => format!("(or {own} (done0))"),
        2 => format!("(not {own})"),
        _ => own,
    }
}

/// Returns an effect on a number.
fn effect(rng: &mut ChaCha8Rng) -> String {
    let fluent = pick(rng, &FLUENTS);
    if rng.random_range(0..4) == 0 {
        let change = pick(rng, &["increase", "decrease"]);
        let rate = pick(rng, &["0.5", "1", "2"]);
        return format!("({change} {fluent} (* #t {rate}))");
    }
    let change = pick(rng, &["increase", "decrease", "assign"]);
    let amount = match rng.random_range(0..5) {
        0 => pick(rng, &FLUENTS).to_owned(),
        1 => "?duration".to_owned(),
        _ => rng.random_range(0..6).to_string(),
    };
    let when = pick(rng, &["start", "end"]);
    format!("(at {when} ({change} {fluent} {amount}))")
}

fn draft(rng: &mut ChaCha8Rng, number: usize, time: &mut f64) -> Draft {
    let mut effects = format!("(at end (done{number}))");
    for _ in 0..rng.random_range(0..3) {
        effects.push(' ');
        effects += &effect(rng);
    }
    let length = rng.random_range(1..7);
    let fluent = pick(rng, &FLUENTS);
    let duration = match rng.random_range(0..6) {
        0 => format!("(= ?duration {fluent})"),
        1 => format!("(and (>= ?duration 1) (<= ?duration {fluent}))"),
        2 => "(and (>= ?duration 1) (<= ?duration 7))".to_owned(),
        _ => format!("(= ?duration {length})"),
    };
    let start = *time + [0.001, 0.5, 1.0, 3.0][rng.random_range(0..4)];
    *time = start + if rng.random() { f64::from(length) } else { 0.3 };
    Draft {
        duration,
        effects,
        conditions: Vec::new(),
        step: format!("{start:.3}: (act{number}) [{length}]"),
    }
}

/// Returns a random problem with a valid plan; conditions are added as long as the plan stays
/// valid.
fn random_scene(seed: u64) -> Option<Scene> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut time = 0.0;
    let count = rng.random_range(2..6);
    let mut drafts: Vec<Draft> = (0..count)
        .map(|number| draft(rng, number, &mut time))
        .collect();
    let values = FLUENTS.map(|fluent| format!("(= {fluent} {})", rng.random_range(0..9)));
    let timed = match rng.random_range(0..3) {
        0 => format!(
            "(at {} (= (n) {}))",
            rng.random_range(1..16),
            rng.random_range(0..9)
        ),
        _ => String::new(),
    };
    let initial = format!("{} {timed}", values.join(" "));
    let made = |drafts: &[Draft]| {
        let scene = made(drafts, &initial);
        let verdict = validate(&scene.task, &scene.plan, &Settings::default());
        matches!(verdict, validate::Verdict::Valid(_)).then_some(scene)
    };
    made(&drafts)?;
    for _ in 0..rng.random_range(3..9) {
        let at = rng.random_range(0..count);
        let when = pick(rng, &["at start", "at start", "at end", "over all"]);
        let condition = format!("({when} {})", comparison(rng));
        drafts[at].conditions.push(condition);
        if made(&drafts).is_none() {
            drafts[at].conditions.pop();
        }
    }
    made(&drafts)
}

fn made(drafts: &[Draft], initial: &str) -> Scene {
    let (mut predicates, mut actions, mut plan) = (String::new(), String::new(), String::new());
    for (number, it) in drafts.iter().enumerate() {
        let _ = write!(predicates, "(done{number}) ");
        let conditions = it.conditions.join(" ");
        let _ = write!(
            actions,
            "(:durative-action act{number} :parameters () :duration {}
               :condition (and {conditions}) :effect (and {}))",
            it.duration, it.effects
        );
        let _ = writeln!(plan, "{}", it.step);
    }
    let domain = format!(
        "(define (domain d) (:requirements :durative-actions :numeric-fluents)
           (:predicates {predicates}) (:functions (n) (m) (k) (u)) {actions})"
    );
    let problem =
        format!("(define (problem x) (:domain d) (:init {initial}) (:goal (and {predicates})))");
    Scene::within(50, &domain, &problem, Some(&plan))
}

/// The worlds include deviations. `ELBOWROOM_NUMBER_SEEDS` is the number of seeds.
#[test]
fn no_start_violates_conditions_on_numbers() {
    let worlds = [
        "",
        "[[duration]]\naction = \"*\"\nuniform = { from = 0.5, to = 1.6 }\nrelative = true
         [[failure]]\naction = \"*\"\nprobability = 0.2\nwhen = \"start\"",
        "[[delay]]\naction = \"*\"\nuniform = { from = 0, to = 0.7 }
         [[failure]]\naction = \"*\"\nprobability = 0.2\nwhen = \"end\"",
    ];
    let (mut drawn, mut reached) = (0, 0);
    for seed in 0..runs("ELBOWROOM_NUMBER_SEEDS", 200) {
        let Some(scene) = random_scene(seed) else {
            continue;
        };
        drawn += 1;
        for executor in EXECUTORS {
            for world in worlds {
                let report = scene.run(executor, &scene.world(world), seed);
                reached += usize::from(report.verdict == Verdict::GoalReached);
            }
        }
    }
    // There are nine runs for each, and most reach the goal.
    assert!(drawn > 40 && reached > drawn * 7, "{reached} in {drawn}");
}
