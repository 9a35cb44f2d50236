//! Facts and fluents after the failure of an action.

use std::sync::Arc;

use elbowroom_execution::{ActionHandle, Command, Ending, Event, World};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::{SimWorld, WorldModel};

const DOMAIN: &str = "(define (domain d) (:requirements :durative-actions)
    (:predicates (lies) (free) (busy) (holds))
    (:durative-action pick :parameters () :duration (= ?duration 2)
      :condition (and (at start (lies)) (at start (free)))
      :effect (and (at start (not (lies))) (at start (not (free))) (at start (busy))
                   (at end (holds)) (at end (not (busy))))))";

const PROBLEM: &str = "(define (problem p) (:domain d) (:init (lies) (free)) (:goal (holds)))";

/// Returns the reports on a pick that fails at its end, in words, and the facts that are true
/// afterwards.
fn state_after_failure(undone: &str) -> (Vec<String>, Vec<String>) {
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(DOMAIN), &source(PROBLEM)).expect("correct");
    let task = Arc::new(Task::new(problem));
    let text = format!(
        "format = \"elbowroom-world\"\nversion = 1
         [[failure]]\naction = \"pick\"\nprobability = 1\n{undone}"
    );
    let model = WorldModel::read(text.as_str(), task.problem()).expect("a correct world");
    let schema = task.problem().schema("pick").expect("an action");
    let command = Command::Start {
        ticket: ActionHandle(0),
        action: Arc::new(task.instantiate(schema, &[]).expect("no arguments")),
        duration: Some(Rational::from(2)),
    };
    let mut world = SimWorld::new(Arc::clone(&task), &model, 1);
    world
        .command(&Rational::ZERO, &command)
        .expect("it is simulated");
    let mut told = Vec::new();
    for _ in 0..2 {
        let passage = world.wait(&Rational::from(5)).expect("it is simulated");
        for observation in passage.observations {
            told.push(match observation.event {
                Event::Ended {
                    ending: Ending::Failed { .. },
                    ..
                } => "failed".to_owned(),
                Event::Fact { fact, truth } => format!("{} {truth}", task.fact_name(fact)),
                _ => continue,
            });
        }
    }
    let facts = world.truth().state().facts.into_iter();
    (told, facts.map(|fact| task.fact_name(fact)).collect())
}

#[test]
fn failed_action_keeps_start_effects() {
    let (told, facts) = state_after_failure("");
    assert_eq!(told, ["failed"]);
    assert_eq!(facts, ["(busy)"]);
}

#[test]
fn undone_start_effects_are_reverted_and_reported() {
    let (told, mut facts) = state_after_failure("undone = true");
    assert_eq!(
        told,
        ["failed", "(lies) true", "(free) true", "(busy) false"]
    );
    facts.sort();
    assert_eq!(facts, ["(free)", "(lies)"]);
}
