//! Mid-execution starts, determinism, limits.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::problem::ObjectId;
use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_planner::{Answer, Settings, Stopped, plan};

use crate::embedded::world::{answer_from, describe, task};

const DELIVERY: &str = "
    (:requirements :typing :durative-actions :timed-initial-literals)
    (:predicates (here) (there) (loaded) (open) (delivered))
    (:durative-action go :parameters () :duration (= ?duration 10)
      :condition (at start (here)) :effect (and (at start (not (here))) (at end (there))))
    (:durative-action drop :parameters () :duration (= ?duration 2)
      :condition (and (over all (there)) (over all (open)) (at start (loaded)))
      :effect (and (at start (not (loaded))) (at end (delivered))))";

/// Returns the situation at time 6 in which an action without arguments has been running since 0,
/// and its start has made a fact false.
fn running_situation(task: &Task, schema: &str, gone: &str, duration: Interval) -> Situation {
    let schema = task.problem().schema(schema).expect("as written");
    let action = task.instantiate(schema, &[]).expect("as written");
    let mut situation = Situation::initial(task);
    let gone = task.problem().predicate(gone).expect("as written");
    let gone = task.find_fact(gone, &[]).expect("as written");
    situation.state.facts.remove(&gone);
    situation.time = 6.into();
    situation.running.push(RunningAction {
        action: Arc::new(action),
        start: Rational::ZERO,
        duration,
    });
    situation
}

/// Returns the situation at 6, on the way since 0 with the parcel.
fn driving_situation(closing: &str, duration: Interval) -> (Task, Situation) {
    let problem =
        format!("(:init (here) (loaded) (open) (at {closing} (not (open)))) (:goal (delivered))");
    let task = task(DELIVERY, &problem);
    let situation = running_situation(&task, "go", "here", duration);
    (task, situation)
}

#[test]
fn end_effect_of_running_action_is_used() {
    let (task, situation) = driving_situation("20", Interval::closed(8.into(), 15.into()));
    let answer = answer_from(&task, &situation, 100);
    assert_eq!(describe(&answer), "0: (go) [8]\n8: (drop) [2]");
}

#[test]
fn running_action_ends_no_earlier_than_now() {
    let (task, situation) = driving_situation("20", Interval::closed(2.into(), 15.into()));
    let answer = answer_from(&task, &situation, 100);
    assert_eq!(describe(&answer), "0: (go) [6]\n6: (drop) [2]");
}

#[test]
fn future_deadline_can_be_unreachable() {
    let (task, situation) = driving_situation("11.9", Interval::closed(10.into(), 15.into()));
    let answer = answer_from(&task, &situation, 100);
    assert_eq!(
        describe(&answer),
        "no plan exists: `(delivered)` cannot be reached before `(open)` closes at 11.9"
    );
}

#[test]
fn past_deadline_is_ignored() {
    let (task, mut situation) = driving_situation("5", Interval::closed(8.into(), 15.into()));
    let open = task.problem().predicate("open").expect("as written above");
    let open = task.find_fact(open, &[]).expect("as written above");
    situation.state.facts.remove(&open);
    let answer = answer_from(&task, &situation, 100);
    assert!(matches!(answer, Answer::Unsolvable { .. }));
}

const TIMELY: &str = "
    (:requirements :typing :durative-actions :numeric-fluents :duration-inequalities)
    (:predicates (idle) (done))
    (:functions (water))
    (:durative-action work :parameters () :duration (= ?duration 2)
      :condition (at start (idle))
      :effect (and (at start (not (idle))) (at end (idle)) (at end (done))))
    (:durative-action fill :parameters () :duration (and (>= ?duration 1) (<= ?duration 9))
      :condition (at start (idle))
      :effect (and (at start (not (idle))) (at end (idle)) (at end (increase (water) (* ?duration 2)))))";

/// Worlds report the time in floats, which no grid contains.
#[test]
fn plan_starts_no_earlier_than_now() {
    for goal in ["(done)", "(>= (water) 5)", "(and (done) (>= (water) 5))"] {
        let problem = format!("(:init (idle) (= (water) 0)) (:goal {goal})");
        let task = task(TIMELY, &problem);
        let mut situation = Situation::initial(&task);
        for time in [
            0.022_737_979_888_916_016,
            0.1,
            6.043_167_626_857_75,
            1e5 / 3.0,
        ] {
            situation.time = Rational::from_f64_as_written(time).expect("finite");
            let answer = answer_from(&task, &situation, 400);
            let Answer::Plan { found, .. } = answer else {
                panic!("{goal} at {time}: {answer}", answer = describe(&answer));
            };
            // The first step does not wait for anything.
            let first = &found.plan.steps[0].start;
            assert_eq!(*first, situation.time, "{goal} at {time}");
        }
    }
}

const GRID: &str = "
    (:requirements :typing :durative-actions :numeric-fluents)
    (:types place) (:predicates (at ?p - place) (next ?a ?b - place) (been ?p - place))
    (:functions (steps))
    (:durative-action go :parameters (?a ?b - place) :duration (= ?duration 1)
      :condition (and (at start (at ?a)) (at start (next ?a ?b)))
      :effect (and (at start (not (at ?a))) (at end (at ?b)) (at end (been ?b))
                   (at end (increase (steps) 1))))";

/// Returns a task on a ring, with a goal that requires more steps than any search can make.
fn endless() -> Task {
    task(
        GRID,
        "(:objects a b c - place) (:init (at a) (next a b) (next b c) (next c a) (next b a)
         (= (steps) 0)) (:goal (and (been c) (at a) (>= (steps) 100000)))",
    )
}

#[test]
fn search_stops_on_request() {
    let task = endless();
    let situation = Situation::initial(&task);
    let answer = answer_from(&task, &situation, 5);
    assert_eq!(describe(&answer), "none found: Interrupted");
}

#[test]
fn a_search_ends_when_its_memory_is_used_up() {
    let task = endless();
    let situation = Situation::initial(&task);
    let settings = Settings {
        max_memory: 1 << 20,
        ..Settings::default()
    };
    let mut most = 0;
    let answer = plan(&task, &situation, &settings, &mut |progress| {
        most = most.max(progress.counts.memory);
        ControlFlow::Continue(())
    });
    let Answer::NoneFound { stopped, .. } = answer else {
        panic!("{}", describe(&answer));
    };
    assert_eq!(stopped, Stopped::OutOfMemory);
    assert!(most < 4 << 20, "{most}");
}

#[test]
fn the_same_problem_has_the_same_answer_and_reports() {
    let run = || {
        let task = task(
            GRID,
            "(:objects a b c - place) (:init (at a) (next a b) (next b c) (next c a) (next b a)
             (= (steps) 0)) (:goal (and (been c) (at a) (>= (steps) 5)))",
        );
        let situation = Situation::initial(&task);
        let mut reports = Vec::new();
        let answer = plan(&task, &situation, &Settings::default(), &mut |progress| {
            reports.push(format!("{progress:?}"));
            if reports.len() > 30 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        (describe(&answer), reports)
    };
    assert_eq!(run(), run());
}

/// Returns the situation at 6 of a tank that has been filling since 0, by two for each unit of
/// time, until the action ends.
fn filling(duration: Interval) -> (Task, Situation) {
    let domain = "
        (:requirements :durative-actions :numeric-fluents)
        (:predicates (idle) (drained)) (:functions (level) (pumped))
        (:durative-action fill :parameters () :duration (= ?duration 8)
          :condition (at start (idle))
          :effect (and (at start (not (idle))) (at end (idle))
            (at end (increase (level) (* 2 ?duration)))
            (at end (increase (pumped) (* 3 ?duration)))))
        (:durative-action drain :parameters () :duration (= ?duration 1)
          :condition (at start (>= (level) 16))
          :effect (and (at start (decrease (level) 16)) (at end (drained))))";
    let problem = "(:init (idle) (= (level) 0) (= (pumped) 0)) (:goal (drained))
        (:metric minimize (pumped))";
    let task = task(domain, problem);
    let situation = running_situation(&task, "fill", "idle", duration);
    (task, situation)
}

#[test]
fn running_action_changes_numbers_by_its_duration() {
    let (task, situation) = filling(Interval::closed(8.into(), 8.into()));
    let answer = answer_from(&task, &situation, 100);
    assert_eq!(describe(&answer), "0: (fill) [8]\n8001/1000: (drain) [1]");
    let whole = plan(&task, &situation, &Settings::default(), &mut |_| {
        ControlFlow::Continue(())
    });
    let found = whole.found().expect("there is a plan");
    assert_eq!(found.metric, Some(24.into()));
}

#[test]
fn overdue_action_changes_numbers_more() {
    // The duration is known, but differs from the domain's.
    let (task, situation) = filling(Interval::closed(10.into(), 10.into()));
    let answer = answer_from(&task, &situation, 100);
    assert_eq!(describe(&answer), "0: (fill) [10]\n10001/1000: (drain) [1]");
    // It may last from 7 to 10: the plan uses the duration that it needs.
    let (task, situation) = filling(Interval::closed(7.into(), 10.into()));
    let answer = answer_from(&task, &situation, 100);
    assert!(
        !matches!(answer, Answer::Unsolvable { .. }),
        "{}",
        describe(&answer)
    );
}

const WATERING: &str = "
    (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals
      :duration-inequalities)
    (:types tank bed)
    (:predicates (ready ?t - tank) (home ?t - tank) (at ?t - tank ?b - bed) (wet ?b - bed)
      (open ?b - bed))
    (:functions (level ?t - tank) (need ?b - bed))
    (:durative-action go :parameters (?t - tank ?b - bed) :duration (= ?duration 3)
      :condition (and (at start (home ?t)) (at start (ready ?t)))
      :effect (and (at start (not (home ?t))) (at end (at ?t ?b))))
    (:durative-action return :parameters (?t - tank ?b - bed) :duration (= ?duration 3)
      :condition (and (at start (at ?t ?b)) (at start (ready ?t)))
      :effect (and (at start (not (at ?t ?b))) (at end (home ?t))))
    (:durative-action water :parameters (?t - tank ?b - bed) :duration (= ?duration (/ (need ?b) 2))
      :condition (and (at start (ready ?t)) (over all (at ?t ?b)) (over all (open ?b))
        (at start (>= (level ?t) (need ?b))))
      :effect (and (at start (not (ready ?t))) (at end (ready ?t)) (at end (wet ?b))
        (decrease (level ?t) (* #t 2))))
    (:durative-action fill :parameters (?t - tank)
      :duration (and (>= ?duration 1) (<= ?duration 30))
      :condition (and (over all (home ?t)) (at start (ready ?t)) (over all (<= (level ?t) 60)))
      :effect (and (at start (not (ready ?t))) (at end (ready ?t))
        (increase (level ?t) (* #t 4))))";

/// A running continuous change of known duration is as easy as one that has ended.
#[test]
fn replanning_during_a_known_drain_needs_few_states() {
    let beds = 0..10;
    let names: String = beds.clone().map(|bed| format!("b{bed} ")).collect();
    let goals: String = beds.clone().map(|bed| format!("(wet b{bed})")).collect();
    let of_beds: String = beds
        .map(|bed| {
            let (need, opens) = (12 + bed * 5 % 12, 1 + bed * 12);
            let [closes, again, last] = [20, 45, 65].map(|time| opens + time);
            format!(
                "(= (need b{bed}) {need}) (at {opens} (open b{bed})) (at {closes} (not (open b{bed})))
                 (at {again} (open b{bed})) (at {last} (not (open b{bed})))"
            )
        })
        .collect();
    let problem = format!(
        "(:objects t1 t2 - tank {names} - bed)
         (:init (home t1) (home t2) (ready t1) (ready t2) (= (level t1) 30) (= (level t2) 30) {of_beds})
         (:goal (and {goals}))"
    );
    let task = task(WATERING, &problem);
    let object = |name| task.problem().object(name).expect("as written");
    let (running, bed) = (object("t1"), object("b0"));
    let fact = |name, arguments: &[ObjectId]| {
        let predicate = task.problem().predicate(name).expect("as written");
        task.find_fact(predicate, arguments).expect("as written")
    };
    let schema = task.problem().schema("water").expect("as written");
    let action = task
        .instantiate(schema, &[running, bed])
        .expect("as written");
    let level = task.problem().function("level").expect("as written");
    let level = task.find_fluent(level, &[running]).expect("as written");
    let mut situation = Situation::initial(&task);
    for gone in ["home", "ready"] {
        situation.state.facts.remove(&fact(gone, &[running]));
    }
    situation.state.facts.insert(fact("at", &[running, bed]));
    situation.state.facts.insert(fact("open", &[bed]));
    situation.state.values.insert(level, 26.into());
    situation.time = 5.into();
    situation.running.push(RunningAction {
        action: Arc::new(action),
        start: 3.into(),
        duration: Interval::point(6.into()),
    });
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    let mut states = 0;
    let answer = plan(&task, &situation, &settings, &mut |progress| {
        states = progress.counts.evaluated;
        if states < 300 {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    assert!(
        answer.found().is_some(),
        "after {states} states: {}",
        describe(&answer)
    );
}
