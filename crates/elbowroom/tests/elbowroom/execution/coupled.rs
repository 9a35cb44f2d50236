//! Plans with happenings that need each other at one moment, and executors that choose orders.

use std::fmt::Write as _;

use elbowroom::execution::run::{Report, Verdict};
use elbowroom::model::TimeTriggeredPlan;
use elbowroom::model::validate::{self, validate};
use elbowroom::sim::WorldModel;
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::execution::scene::{Scene, runs};

const ADAPTIVE: [&str; 2] = ["adaptable", "lookahead"];

const CERTAIN: &str =
    "[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0\n";

/// Returns a domain with the facts `p`, `q`, `r` and one more for each action, which its end adds.
/// The goal is all of these.
fn scene(actions: &[(&str, &str, &str, &str)], init: &str, plan: &str) -> Scene {
    let mut domain = "(define (domain d) (:requirements :durative-actions :duration-inequalities
        :disjunctive-preconditions :negative-preconditions :numeric-fluents :timed-initial-literals)
      (:predicates (p) (q) (r)"
        .to_owned();
    for (name, ..) in actions {
        let _ = write!(domain, " ({name}-done)");
    }
    domain.push_str(") (:functions (load))");
    let mut goal = String::new();
    for (name, duration, conditions, effects) in actions {
        let _ = write!(
            domain,
            "(:durative-action {name} :parameters () :duration {duration}
               :condition (and {conditions}) :effect (and {effects} (at end ({name}-done))))"
        );
        let _ = write!(goal, "({name}-done)");
    }
    domain.push(')');
    let problem = format!(
        "(define (problem x) (:domain d) (:init (= (load) 1) {init}) (:goal (and {goal})))"
    );
    let mut scene = Scene::new(&domain, &problem, Some(plan));
    scene.settings.max_replans = 0;
    scene
}

/// Returns two actions whose starts make each other's condition true, and whose ends make it false.
fn pair() -> Scene {
    let a = (
        "a",
        "(= ?duration 3)",
        "(over all (p))",
        "(at start (q)) (at end (not (q)))",
    );
    let b = (
        "b",
        "(= ?duration 3)",
        "(over all (q))",
        "(at start (p)) (at end (not (p)))",
    );
    scene(&[a, b], "", "1: (a) [3]\n1: (b) [3]")
}

fn circle() -> Scene {
    let actions = [
        ("a", "(= ?duration 3)", "(over all (p))", "(at start (q))"),
        ("b", "(= ?duration 3)", "(over all (q))", "(at start (r))"),
        ("c", "(= ?duration 2)", "(over all (r))", "(at start (p))"),
    ];
    scene(&actions, "", "1: (a) [3]\n1: (b) [3]\n1: (c) [2]")
}

/// Returns a plan with an action `c`, during which `a` ends at the moment of the start of `b`.
/// Before that end `b` lacks `r`, and after it `c` lacks `p` until `b` starts.
fn relay() -> Scene {
    let actions = [
        ("c", "(= ?duration 9)", "(over all (or (p) (q)))", ""),
        (
            "a",
            "(= ?duration 3)",
            "(at start (p))",
            "(at end (not (p))) (at end (r))",
        ),
        ("b", "(= ?duration 8)", "(over all (r))", "(at start (q))"),
    ];
    scene(&actions, "(p)", "1: (c) [9]\n1: (a) [3]\n4: (b) [8]")
}

/// Returns a plan with an action `c` that needs a load of exactly 1.
fn load() -> Scene {
    let actions = [
        (
            "c",
            "(= ?duration 9)",
            "(over all (>= (load) 1)) (over all (<= (load) 1)) (at start (p))",
            "(at start (r)) (at end (not (r)))",
        ),
        (
            "a",
            "(= ?duration 3)",
            "(at start (r))",
            "(at start (q)) (at end (decrease (load) 1))",
        ),
        (
            "b",
            "(= ?duration 3)",
            "(at start (q)) (at end (r))",
            "(at start (increase (load) 1))",
        ),
    ];
    scene(&actions, "(p)", "0: (c) [9]\n1: (a) [3]\n4: (b) [3]")
}

/// Returns a plan with an action of duration 0 whose end is needed at the moment of its start.
fn timeless() -> Scene {
    let actions = [
        ("a", "(>= ?duration 0)", "(over all (p))", "(at end (q))"),
        ("b", "(= ?duration 2)", "(at start (q))", ""),
    ];
    scene(&actions, "", "1: (a) [0]\n2: (b) [2]")
}

/// Returns a plan with a timed initial literal at 5 that deletes `p`, and adds `r` for the start of
/// `b`.
fn relief() -> Scene {
    let actions = [
        ("c", "(= ?duration 9)", "(over all (or (p) (q)))", ""),
        ("b", "(= ?duration 3)", "(over all (r))", "(at start (q))"),
    ];
    let init = "(p) (at 5 (not (p))) (at 5 (r))";
    scene(&actions, init, "0: (c) [9]\n5: (b) [3]")
}

fn scenes() -> [(&'static str, Scene); 6] {
    [
        ("pair", pair()),
        ("circle", circle()),
        ("relay", relay()),
        ("load", load()),
        ("timeless", timeless()),
        ("relief", relief()),
    ]
}

/// Returns one of the scenes without a likelihood file.
fn scene_without(name: &str) -> Scene {
    let mut scenes = scenes().into_iter();
    let found = scenes.find(|(own, _)| *own == name);
    found.expect("a correct test").1
}

fn has_reached(report: &Report) -> bool {
    report.verdict == Verdict::GoalReached
}

#[test]
fn plan_with_coupled_happenings_reaches_the_goal() {
    for (name, scene) in scenes() {
        let likely =
            "[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.01\nstart = 0.9\neffect = 1.0\n";
        for scene in [scene.with_likelihoods(likely), scene_without(name)] {
            for executor in ADAPTIVE.iter().chain(&["esterel", "live"]) {
                let report = scene.run(executor, &WorldModel::without_deviations(), 0);
                assert!(has_reached(&report), "{name}, {executor}: {report:#?}");
                let judged = scene.judged(&report);
                assert!(judged.is_valid(), "{name}, {executor}: {judged:?}");
            }
        }
    }
}

#[test]
fn coupled_starts_are_one_decision() {
    for scene in [pair(), circle()] {
        let report = scene.run("adaptable", &WorldModel::without_deviations(), 0);
        let starts = report.executed.iter().map(|it| it.step.start.clone());
        assert!(starts.clone().all(|start| start.is_zero()), "{report:#?}");
        assert_eq!(report.starts, scene.plan.steps.len(), "{report:#?}");
    }
}

/// If one of several simultaneous starts fails, all are tried again together.
#[test]
fn coupled_starts_are_retried_after_failures() {
    for name in ["pair", "circle"] {
        for undone in ["", "undone = true\n"] {
            let likely = format!("{CERTAIN}[actions.a]\nstart = 0.6\nend = 0.7\n{undone}");
            let mut scene = scene_without(name).with_likelihoods(&likely);
            scene.settings.max_replans = 100;
            let world = scene.world(&format!(
                "[[failure]]\naction = \"a\"\nwhen = \"start\"\nprobability = 0.4\n\
                 [[failure]]\naction = \"a\"\nprobability = 0.3\n{undone}"
            ));
            for executor in ADAPTIVE {
                let mut retries = 0;
                for seed in 0..20 {
                    let report = scene.run(executor, &world, seed);
                    let words = format!("{name} {undone}{executor} {seed}: {report:#?}");
                    assert!(has_reached(&report), "{words}");
                    retries += report.executed.len().saturating_sub(scene.plan.steps.len());
                }
                assert!(retries > 5, "{name}, {executor}: {retries}");
            }
        }
    }
}

// Random plans.

fn literal(rng: &mut ChaCha8Rng) -> String {
    let fact = ["p", "q", "r"].choose(rng).expect("not empty");
    if rng.random_bool(0.2) {
        format!("(not ({fact}))")
    } else {
        format!("({fact})")
    }
}

fn random(rng: &mut ChaCha8Rng) -> Option<(Scene, String)> {
    let names = ["a", "b", "c"];
    let has_load = rng.random_bool(0.3);
    // Half of the plans have a cycle: each start adds the condition of the next action.
    let is_circle = rng.random_bool(0.5);
    let facts = ["p", "q", "r"];
    let origin = rng.random_range(0..3);
    let mut plan = String::new();
    let mut texts = Vec::new();
    for (place, name) in names.into_iter().enumerate() {
        let is_timeless = rng.random_bool(0.1);
        let duration = if is_timeless {
            0
        } else {
            rng.random_range(1..4)
        };
        let is_in_circle = is_circle && (place < 2 || origin == 0);
        let start = if is_in_circle {
            origin
        } else {
            rng.random_range(0..3)
        };
        let _ = writeln!(plan, "{start}: ({name}) [{duration}]");
        let mut conditions = String::new();
        if rng.random_bool(0.2) {
            let _ = write!(conditions, "(at start {})", literal(rng));
        }
        if rng.random_bool(0.7) {
            let condition = match rng.random_range(0..4) {
                0 => format!("(or {} {})", literal(rng), literal(rng)),
                1 if has_load => "(and (>= (load) 1) (<= (load) 1))".to_owned(),
                _ => literal(rng),
            };
            let _ = write!(conditions, "(over all {condition})");
        }
        let mut effects = String::new();
        if is_in_circle {
            let length = if origin == 0 { 3 } else { 2 };
            let (gives, needs) = (facts[(place + 1) % length], facts[place]);
            let _ = write!(conditions, "(over all ({needs}))");
            let _ = write!(effects, "(at start ({gives}))");
        }
        for when in ["start", "end"] {
            if rng.random_bool(if is_in_circle { 0.2 } else { 0.6 }) {
                let _ = write!(effects, "(at {when} {})", literal(rng));
            }
            if has_load && rng.random_bool(0.4) {
                let change = ["increase", "decrease"].choose(rng).expect("not empty");
                let _ = write!(effects, "(at {when} ({change} (load) 1))");
            }
        }
        texts.push((
            name,
            format!("(= ?duration {duration})"),
            conditions,
            effects,
        ));
    }
    let actions: Vec<_> = texts
        .iter()
        .map(|(name, duration, conditions, effects)| {
            (
                *name,
                duration.as_str(),
                conditions.as_str(),
                effects.as_str(),
            )
        })
        .collect();
    let mut init = String::new();
    for fact in ["p", "q", "r"] {
        if rng.random_bool(0.3) {
            let _ = write!(init, "({fact})");
        }
    }
    if rng.random_bool(0.2) {
        let _ = write!(init, "(at {} {})", rng.random_range(1..4), literal(rng));
    }
    let scene = scene(&actions, &init, &plan);
    let text = format!("{actions:#?}\n{init}\n{plan}");
    is_valid(&scene, &scene.plan).then_some((scene, text))
}

fn is_valid(scene: &Scene, plan: &TimeTriggeredPlan) -> bool {
    validate(&scene.task, plan, &validate::Settings::default()).is_valid()
}

/// Returns `true` if the plan is valid with its simultaneous happenings a little apart, in some
/// order.
fn works_apart(scene: &Scene) -> bool {
    let tenth = elbowroom::num::Rational::new(1, 100);
    let orders = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    orders.iter().any(|order| {
        let mut plan = scene.plan.clone();
        for (step, place) in plan.steps.iter_mut().zip(order) {
            step.start = &step.start + &tenth * elbowroom::num::Rational::from(*place);
        }
        is_valid(scene, &plan)
    })
}

/// Executors that choose orders reach the goal if executors that follow the plan do.
#[test]
fn random_plans_are_executed_where_baselines_execute_them() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (mut plans, mut coupled) = (0, 0);
    for round in 0..runs("COUPLED", 3000) {
        let Some((scene, text)) = random(&mut rng) else {
            continue;
        };
        let world = WorldModel::without_deviations();
        let baselines = ["esterel", "live"];
        let reach = |executor: &&str| has_reached(&scene.run(executor, &world, 0));
        if !baselines.iter().any(reach) {
            continue;
        }
        plans += 1;
        coupled += u32::from(!works_apart(&scene));
        for executor in ADAPTIVE {
            let report = scene.run(executor, &world, 0);
            assert!(
                has_reached(&report) && scene.judged(&report).is_valid(),
                "round {round}, {executor}: {:?} {:?} {:?}\n{text}",
                report.verdict,
                report.reasons,
                report.executed
            );
        }
    }
    println!("{plans} plans, {coupled} of them coupled");
    assert!(plans > 100 && coupled > 20, "{plans}, {coupled}");
}
