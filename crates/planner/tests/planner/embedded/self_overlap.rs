//! Plans with and without self-overlap.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_planner::{Answer, Proof, Settings, plan};

use crate::embedded::world::{describe, task};

/// `bake` takes 3 and counts at its end; nothing keeps two of them apart.
const OVEN: &str = "
    (:requirements :fluents)
    (:functions (baked))
    (:durative-action bake :parameters () :duration (= ?duration 3)
      :effect (at end (increase (baked) 1)))";

/// Only two instances of `hold` at a time let `lift` happen.
const HANDS: &str = "
    (:requirements :fluents)
    (:predicates (lifted))
    (:functions (hands))
    (:durative-action hold :parameters () :duration (= ?duration 2)
      :condition (at start (< (hands) 2))
      :effect (and (at start (increase (hands) 1)) (at end (decrease (hands) 1))))
    (:action lift :parameters () :precondition (>= (hands) 2) :effect (lifted))";

/// Returns the best plan after 300 reports.
fn answer(task: &Task, situation: &Situation, self_overlap: bool) -> Answer {
    let settings = Settings {
        self_overlap,
        ..Settings::default()
    };
    let mut left = 300;
    plan(task, situation, &settings, &mut |_| {
        left -= 1;
        if left == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

#[test]
fn instances_run_in_turn_unless_self_overlap_is_allowed() {
    let task = task(OVEN, "(:init (= (baked) 0)) (:goal (>= (baked) 3))");
    let situation = Situation::initial(&task);
    for (self_overlap, makespan) in [(false, 9), (true, 3)] {
        let answer = answer(&task, &situation, self_overlap);
        let found = answer.found().expect("a plan");
        assert_eq!(found.makespan, makespan.into(), "{}", describe(&answer));
        assert_eq!(found.plan.self_overlap().is_some(), self_overlap);
    }
}

#[test]
fn exhausted_search_excludes_only_plans_without_self_overlap() {
    let task = task(HANDS, "(:init (= (hands) 0)) (:goal (lifted))");
    let situation = Situation::initial(&task);
    let without = answer(&task, &situation, false);
    let is_restricted = matches!(
        without,
        Answer::Unsolvable {
            proof: Proof::WithoutSelfOverlap { .. },
            ..
        } | Answer::NoneFound {
            without_self_overlap: true,
            ..
        }
    );
    assert!(is_restricted, "{}", describe(&without));
    let with = answer(&task, &situation, true);
    assert!(with.found().is_some(), "{}", describe(&with));
}

#[test]
fn exhausted_search_excludes_all_plans_where_no_action_can_overlap_itself() {
    let task = task(
        "(:predicates (free) (p) (q))
         (:durative-action a :parameters () :duration (= ?duration 2)
           :condition (at start (free))
           :effect (and (at start (not (free))) (at end (free)) (at start (p)) (at end (not (p)))))
         (:durative-action b :parameters () :duration (= ?duration 3)
           :condition (and (at start (free)) (over all (p)))
           :effect (and (at start (not (free))) (at end (free)) (at end (q))))",
        "(:init (free)) (:goal (q))",
    );
    let answer = answer(&task, &Situation::initial(&task), false);
    assert!(
        matches!(&answer, Answer::Unsolvable { proof, .. } if !matches!(proof, Proof::WithoutSelfOverlap { .. })),
        "{}",
        describe(&answer)
    );
}

#[test]
fn new_instance_of_running_action_starts_after_its_end() {
    let task = task(OVEN, "(:init (= (baked) 0)) (:goal (>= (baked) 2))");
    let mut situation = Situation::initial(&task);
    let bake = task.problem().schema("bake").expect("as written");
    let action = task.instantiate(bake, &[]).expect("as written");
    situation.time = 1.into();
    situation.running.push(RunningAction {
        action: Arc::new(action),
        start: Rational::ZERO,
        duration: Interval::closed(3.into(), 5.into()),
    });
    for (self_overlap, expected) in [
        (false, "0: (bake) [3]\n3: (bake) [3]"),
        (true, "0: (bake) [3]\n1: (bake) [3]"),
    ] {
        let answer = answer(&task, &situation, self_overlap);
        assert_eq!(describe(&answer), expected);
    }
}

#[test]
fn plans_for_cases_have_no_self_overlap() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let mut planned = 0;
    for case in std::fs::read_dir(cases).expect("the cases").flatten() {
        let text = |name: &str| {
            let path = case.path().join(name);
            let text = std::fs::read_to_string(&path).ok()?;
            Some(Source::new(name, text))
        };
        let (Some(domain), Some(problem)) = (text("domain.pddl"), text("problem.pddl")) else {
            continue;
        };
        let (problem, _) = read_problem(&domain, &problem).expect("a case");
        let task = Task::new(problem);
        let answer = answer(&task, &Situation::initial(&task), false);
        let place = case.path();
        match &answer {
            Answer::Plan { found, .. } => {
                assert_eq!(found.plan.self_overlap(), None, "{}", place.display());
                planned += 1;
            }
            Answer::Unsolvable { .. } => panic!("{}: {}", place.display(), describe(&answer)),
            Answer::NoneFound { .. } | Answer::Unsupported(_) => {}
        }
    }
    assert!(planned >= 5, "{planned} cases have a plan");
}
