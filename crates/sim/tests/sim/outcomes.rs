//! Random outcomes of failures, and their delays.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::{ActionHandle, Command, Ending, Event, World};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::{SimWorld, WorldModel};

const DOMAIN: &str = "(define (domain d) (:requirements :typing :durative-actions :fluents)
    (:types box place)
    (:predicates (lies ?b - box) (fallen ?b - box) (at ?b - box ?p - place) (free))
    (:functions (tries ?b - box) (charge))
    (:durative-action pick :parameters (?b - box) :duration (= ?duration 4)
      :condition (at start (lies ?b))
      :effect (and (at start (not (lies ?b))) (at start (not (free))) (at end (free)))))";

const PROBLEM: &str = "(define (problem p) (:domain d) (:objects a b - box floor - place)
    (:init (lies a) (lies b) (free) (= (charge) 9) (= (tries a) 0) (= (tries b) 0))
    (:goal (free)))";

fn task() -> Arc<Task> {
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(DOMAIN), &source(PROBLEM)).expect("correct");
    Arc::new(Task::new(problem))
}

fn model(task: &Task, failure: &str) -> WorldModel {
    let text = format!("format = \"elbowroom-world\"\nversion = 1\n[[failure]]\n{failure}");
    WorldModel::read(text.as_str(), task.problem()).expect("a correct world")
}

/// Returns the reports on a pick of box a, with their times, and the world afterwards. The pick is
/// cancelled at that time.
fn picked<'a>(
    task: &Arc<Task>,
    model: &'a WorldModel,
    seed: u64,
    cancelled: Option<i64>,
) -> (Vec<String>, SimWorld<'a>) {
    let schema = task.problem().schema("pick").expect("an action");
    let object = task.problem().object("a").expect("an object");
    let mut world = SimWorld::new(Arc::clone(task), model, seed);
    let command = Command::Start {
        ticket: ActionHandle(0),
        action: Arc::new(task.instantiate(schema, &[object]).expect("a box")),
        duration: Some(Rational::from(4)),
    };
    world.command(&Rational::ZERO, &command).expect("simulated");
    let mut told = Vec::new();
    let mut listen = |world: &mut SimWorld<'_>, until: i64| {
        let until = Rational::from(until);
        loop {
            let passage = world.wait(&until).expect("simulated");
            for observation in passage.observations {
                let words = match observation.event {
                    Event::Ended {
                        ending: Ending::Failed { .. },
                        ..
                    } => "failed".to_owned(),
                    Event::Ended {
                        ending: Ending::Cancelled,
                        ..
                    } => "cancelled".to_owned(),
                    Event::Ended { .. } => "succeeded".to_owned(),
                    Event::Fact { fact, truth } => format!("{} {truth}", task.fact_name(fact)),
                    Event::Value { fluent, value } => {
                        format!("{} {value}", task.fluent_name(fluent))
                    }
                    _ => continue,
                };
                told.push(format!("{}: {words}", observation.time));
            }
            if passage.now >= until {
                return;
            }
        }
    };
    if let Some(time) = cancelled {
        listen(&mut world, time);
        let command = Command::Cancel {
            ticket: ActionHandle(0),
        };
        let now = Rational::from(time);
        world.command(&now, &command).expect("simulated");
    }
    listen(&mut world, 20);
    (told, world)
}

const DROPPED: &str = "action = \"pick\"\nprobability = 1\nundone = true
    [[failure.outcome]]\nprobability = 1\nbecomes_true = [\"(fallen ?b)\", \"(at ?b floor)\"]
    becomes_false = [\"(lies ?b)\"]\nassign = { \"(tries ?b)\" = 3 }
    decrease = { \"(charge)\" = 2.5 }\ndelay = 6\n";

#[test]
fn outcome_uses_action_objects_and_follows_undoing() {
    let task = task();
    let model = model(&task, DROPPED);
    let (told, world) = picked(&task, &model, 1, None);
    assert_eq!(
        told,
        [
            "10: failed",
            "10: (lies a) true",
            "10: (free) true",
            "10: (fallen a) true",
            "10: (at a floor) true",
            "10: (lies a) false",
            "10: (tries a) 3",
            "10: (charge) 13/2",
        ]
    );
    let mut facts: Vec<String> = world
        .truth()
        .state()
        .facts
        .into_iter()
        .map(|fact| task.fact_name(fact))
        .collect();
    facts.sort();
    assert_eq!(facts, ["(at a floor)", "(fallen a)", "(free)", "(lies b)"]);
}

#[test]
fn unreported_outcome_still_happens() {
    let task = task();
    let text = DROPPED.replace("undone = true", "") + "reported = false\n";
    let model = model(&task, &text);
    let (told, world) = picked(&task, &model, 1, None);
    assert_eq!(told, ["10: failed"]);
    let fact = task.fact_named("(fallen a)").expect("a fact");
    assert!(world.truth().fact(fact));
}

#[test]
fn broken_action_is_not_released_before_failure() {
    let task = task();
    let model = model(&task, DROPPED);
    let before = picked(&task, &model, 1, Some(3)).0;
    assert_eq!(before, ["3: cancelled"]);
    let (told, _) = picked(&task, &model, 1, Some(5));
    assert_eq!(told[0], "10: failed");
    assert_eq!(told.len(), 8);
}

#[test]
fn failed_start_has_outcome() {
    let task = task();
    let text = "action = \"(pick a)\"\nprobability = 1\nwhen = \"start\"
        [[failure.outcome]]\nprobability = 1\nincrease = { \"(tries a)\" = 1 }\ndelay = 2\n";
    let model = model(&task, text);
    let (told, _) = picked(&task, &model, 1, None);
    assert_eq!(told, ["2: failed", "2: (tries a) 1"]);
}

#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few runs")]
fn outcome_frequencies_match_file() {
    const RUNS: u64 = 4000;
    let task = task();
    let text = "action = \"pick\"\nprobability = 0.6
        [[failure.outcome]]\nprobability = 0.5\nbecomes_true = [\"(fallen ?b)\"]
        [[failure.outcome]]\nprobability = 0.3\ndelay = 3\nbecomes_true = [\"(lies ?b)\"]\n";
    let model = model(&task, text);
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for seed in 0..RUNS {
        let (told, _) = picked(&task, &model, seed, None);
        *counts.entry(told.join(", ")).or_default() += 1;
    }
    let expected = [
        ("4: succeeded", 0.4),
        ("4: failed, 4: (fallen a) true", 0.3),
        ("7: failed, 7: (lies a) true", 0.18),
        ("4: failed", 0.12),
    ];
    assert_eq!(counts.len(), expected.len(), "{counts:?}");
    for (told, share) in expected {
        let found = f64::from(counts[told]) / RUNS as f64;
        let doubt = 4.0 * (share * (1.0 - share) / RUNS as f64).sqrt();
        assert!(
            (found - share).abs() < doubt,
            "{told}: {found}, not {share}"
        );
    }
}

#[test]
fn outcomes_do_not_affect_other_random_draws() {
    let task = task();
    let plain = "action = \"pick\"\nprobability = 0.5\nwhen = \"midway\"\n";
    let with = format!(
        "{plain}[[failure.outcome]]\nprobability = 0.5\nbecomes_true = [\"(fallen ?b)\"]\n"
    );
    let (plain, with) = (model(&task, plain), model(&task, &with));
    for seed in 0..50 {
        let (first, _) = picked(&task, &plain, seed, None);
        let (second, _) = picked(&task, &with, seed, None);
        assert_eq!(first[0], second[0]);
    }
}
