//! The planner makes no further report after it is stopped at any of its reports.

use std::fmt::Write;
use std::ops::ControlFlow;

use elbowroom_model::{Situation, Task};
use elbowroom_planner::{Answer, Phase, Settings, Stopped, plan};

use crate::embedded::world::task;

/// Stops the planner at its report of that number. Returns the answer, and the phase of each
/// report.
fn stopped_at(task: &Task, number: usize) -> (Answer, Vec<Phase>) {
    let task = task.clone();
    let situation = Situation::initial(&task);
    let mut phases = Vec::new();
    let answer = plan(&task, &situation, &Settings::default(), &mut |progress| {
        phases.push(progress.phase);
        if phases.len() < number {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    (answer, phases)
}

/// Trips through three of 20 places: thousands of ground actions, few of which are needed.
fn travels() -> Task {
    let names: String = (0..20).map(|n| format!("p{n} ")).collect();
    let mut been = String::new();
    for n in 1..20 {
        write!(been, "(been p{n}) ").expect("strings take all");
    }
    task(
        "(:requirements :typing :durative-actions)
         (:types place) (:predicates (at ?p - place) (been ?p - place))
         (:durative-action travel :parameters (?a ?b ?c - place) :duration (= ?duration 1)
           :condition (at start (at ?a))
           :effect (and (at start (not (at ?a))) (at end (at ?c)) (at end (been ?b))
                        (at end (been ?c))))",
        &format!("(:objects {names} - place) (:init (at p0)) (:goal (and {been}))"),
    )
}

#[test]
fn each_report_can_be_the_last_one() {
    let task = travels();
    let (_, phases) = stopped_at(&task, 120);
    let before_search = phases.iter().filter(|phase| **phase == Phase::Grounding);
    assert!(
        before_search.count() > 60,
        "grounding and compiling 8000 actions asks often: {phases:?}"
    );
    assert_eq!(phases.len(), 120);
    for number in (1..120).step_by(7) {
        let (answer, reports) = stopped_at(&task, number);
        assert_eq!(reports.len(), number);
        assert_eq!(reports, phases[..number]);
        match answer {
            Answer::Plan { stopped, .. } | Answer::NoneFound { stopped, .. } => {
                assert_eq!(stopped, Stopped::Interrupted);
            }
            other => panic!("{other:?}"),
        }
    }
}
