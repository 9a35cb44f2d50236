//! Times that are not on any grid of the planner, as worlds report them.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{End, Interval};
use elbowroom_planner::{Answer, FoundPlan, Settings, Stopped, plan};

use crate::embedded::world::{describe, task};

/// Returns the first plan, or the answer after `states` states.
fn answer_within(task: &Task, situation: &Situation, states: u64) -> Answer {
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    plan(task, situation, &settings, &mut |progress| {
        if progress.counts.evaluated < states {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    })
}

fn found(answer: &Answer) -> &FoundPlan {
    let found = answer.found();
    found.unwrap_or_else(|| panic!("{}", describe(answer)))
}

/// Returns an action that has been running since `start`.
fn running(
    task: &Task,
    (schema, arguments): (&str, &[&str]),
    start: &str,
    duration: Interval,
) -> RunningAction {
    let schema = task.problem().schema(schema).unwrap();
    let object = |name: &&str| task.problem().object(name).unwrap();
    let arguments: Vec<_> = arguments.iter().map(object).collect();
    RunningAction {
        action: Arc::new(task.instantiate(schema, &arguments).unwrap()),
        start: start.parse().unwrap(),
        duration,
    }
}

fn fixed(duration: i64) -> Interval {
    Interval::closed(duration.into(), duration.into())
}

/// Couriers that bring letters, and rest for any duration.
const COURIERS: &str = "
    (:requirements :typing :durative-actions :numeric-fluents :duration-inequalities)
    (:types courier place letter)
    (:constants home - place)
    (:predicates (at ?c - courier ?p - place) (idle ?c - courier) (lies ?l - letter ?p - place)
      (has ?c - courier ?l - letter) (accessible ?p - place))
    (:functions (strength ?c - courier) (way ?a ?b - place))
    (:durative-action walk :parameters (?c - courier ?a ?b - place)
      :duration (= ?duration (way ?a ?b))
      :condition (and (at start (at ?c ?a)) (at start (idle ?c))
        (at start (>= (strength ?c) (way ?a ?b))) (over all (accessible ?b)))
      :effect (and (at start (not (at ?c ?a))) (at start (not (idle ?c))) (at end (at ?c ?b))
        (at end (idle ?c)) (at end (decrease (strength ?c) (way ?a ?b)))))
    (:durative-action deliver :parameters (?c - courier ?l - letter ?p - place)
      :duration (= ?duration 1)
      :condition (and (at start (idle ?c)) (over all (at ?c ?p)) (at start (has ?c ?l)))
      :effect (and (at start (not (idle ?c))) (at start (not (has ?c ?l))) (at end (lies ?l ?p))
        (at end (idle ?c))))
    (:durative-action rest :parameters (?c - courier)
      :duration (and (>= ?duration 1) (<= ?duration 10))
      :condition (and (at start (idle ?c)) (over all (at ?c home)))
      :effect (and (at start (not (idle ?c))) (at end (idle ?c))
        (at end (increase (strength ?c) (* 2 ?duration)))))";

/// Returns a task with Ann and Bob between three places.
fn couriers(init: &str, goal: &str) -> Task {
    task(
        COURIERS,
        &format!(
            "(:objects ann bob - courier mill inn - place red blue - letter)
             (:init {init} (accessible home) (accessible inn)
               (= (way home mill) 2) (= (way mill home) 2) (= (way home inn) 3)
               (= (way inn home) 3) (= (way mill inn) 2) (= (way inn mill) 2)
               (= (way home home) 1) (= (way mill mill) 1) (= (way inn inn) 1))
             (:goal {goal})"
        ),
    )
}

/// Returns a situation with both on their way. The durations of rests can be chosen, so that linear
/// programs compute the times.
fn driving_situation() -> (Task, Situation) {
    let task = couriers(
        "(has ann blue) (has bob red) (= (strength ann) 20) (= (strength bob) 16) (accessible mill)",
        "(and (lies red mill) (at ann inn) (lies blue inn) (at bob inn))",
    );
    let mut situation = Situation::initial(&task);
    situation.time = "4358952833175659/1000000000000000".parse().unwrap();
    for (arguments, start, duration) in [
        (
            ["ann", "home", "inn"],
            "2154487729072571/500000000000000",
            3,
        ),
        (
            ["bob", "home", "mill"],
            "4309608221054077/1000000000000000",
            2,
        ),
    ] {
        let running = running(&task, ("walk", &arguments), start, fixed(duration));
        situation.running.push(running);
    }
    (task, situation)
}

#[test]
fn running_action_ends_exactly_when_other_durations_are_chosen() {
    let (task, situation) = driving_situation();
    let answer = answer_within(&task, &situation, 100);
    assert_eq!(
        describe(&answer),
        "2154487729072571/500000000000000: (walk ann home inn) [3]
4309608221054077/1000000000000000: (walk bob home mill) [2]
6310608221054077/1000000000000000: (deliver bob red mill) [1]
3654987729072571/500000000000000: (deliver ann blue inn) [1]
7311608221054077/1000000000000000: (walk bob mill inn) [2]"
    );
}

/// Up to the first plan, including the computation of its times.
#[test]
fn each_report_can_be_the_last_one() {
    let (task, situation) = driving_situation();
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    for last in 1.. {
        let mut reports = 0;
        let answer = plan(&task, &situation, &settings, &mut |_| {
            reports += 1;
            if reports < last {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        match answer {
            Answer::Plan {
                stopped: Stopped::FirstPlan,
                ..
            } => {
                assert!(reports < last);
                return;
            }
            Answer::NoneFound { stopped, .. } | Answer::Plan { stopped, .. } => {
                assert_eq!(stopped, Stopped::Interrupted);
            }
            other => panic!("{}", describe(&other)),
        }
        assert_eq!(reports, last);
    }
}

#[test]
fn duration_of_running_action_counts_from_exact_start() {
    let task = couriers(
        "(at ann home) (= (strength ann) 4) (= (strength bob) 0)",
        "(and (idle ann) (>= (strength ann) 10))",
    );
    let mut situation = Situation::initial(&task);
    situation.time = "1.98765432109876".parse().unwrap();
    let start = "0.12345678901234";
    let duration = Interval::closed(1.into(), 10.into());
    let rest = running(&task, ("rest", &["ann"]), start, duration);
    situation.running.push(rest);
    let answer = answer_within(&task, &situation, 100);
    assert_eq!(
        describe(&answer),
        "6172839450617/50000000000000: (rest ann) [3]"
    );
}

#[test]
fn action_waits_for_fixed_time_when_other_durations_are_chosen() {
    let task = couriers(
        "(at ann home) (idle ann) (= (strength ann) 4) (= (strength bob) 0)
         (at 5.00000000000001 (accessible mill))",
        "(at ann mill)",
    );
    let answer = answer_within(&task, &Situation::initial(&task), 100);
    let found = found(&answer);
    let start = &found.plan.steps[0].start;
    assert!(*start >= "5.00000000000001".parse().unwrap() && *start < "5.0011".parse().unwrap());
}

const GATE: &str = "
    (:requirements :durative-actions :timed-initial-literals)
    (:predicates (open) (inside))
    (:durative-action enter :parameters () :duration (and (>= ?duration 1) (<= ?duration 20))
      :condition (at end (open)) :effect (at end (inside)))";

#[test]
fn running_action_ends_when_its_gate_opens() {
    let task = task(GATE, "(:init (at 8 (open))) (:goal (inside))");
    let mut situation = Situation::initial(&task);
    situation.time = 6.into();
    let duration = Interval::closed(1.into(), 20.into());
    let enter = running(&task, ("enter", &[]), "0.12345678901234", duration);
    situation.running.push(enter);
    let answer = answer_within(&task, &situation, 100);
    let found = found(&answer);
    assert!(found.makespan > 8.into() && found.makespan < "8.0011".parse().unwrap());
}

#[test]
fn running_action_respects_open_duration_bound() {
    let task = task(GATE, "(:init (open)) (:goal (inside))");
    let mut situation = Situation::initial(&task);
    situation.time = 1.into();
    let duration = Interval {
        lower: End::Open(2.into()),
        upper: End::Closed(4.into()),
    };
    let enter = running(&task, ("enter", &[]), "0.12345678901234", duration);
    situation.running.push(enter);
    let answer = answer_within(&task, &situation, 100);
    let found = found(&answer);
    let duration = found.plan.steps[0].duration.clone().unwrap();
    assert!(duration > 2.into() && duration < "2.0001".parse().unwrap());
}

/// Off the grid by less than a tick, no time is left. So the validator rejects every plan, and the
/// candidates become longer and longer.
#[test]
fn candidates_rejected_by_validator_count_as_states() {
    let task = task(
        "(:requirements :durative-actions :numeric-fluents :timed-initial-literals)
         (:predicates (open) (over)) (:functions (knocks))
         (:action knock :parameters () :precondition () :effect (increase (knocks) 1))
         (:durative-action pass :parameters () :duration (= ?duration 1.00000000000001)
           :condition (over all (open)) :effect (at end (over)))",
        "(:init (= (knocks) 0) (at 1 (open)) (at 2 (not (open))))
         (:goal (and (over) (>= (knocks) 3)))",
    );
    let answer = answer_within(&task, &Situation::initial(&task), 2000);
    let Answer::NoneFound { counts, .. } = &answer else {
        panic!("{}", describe(&answer));
    };
    // Except for the first one of each search, each evaluated state has been generated before.
    assert!(counts.evaluated > 2 * counts.generated, "{counts:?}");
}
