//! Changes of facts and numbers, and unexpected events.

use elbowroom::execute::{Embedded, Execution};
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{
    ActionHandle, Event, Observation, PlanAnswer, Planner, PlannerAnswer, Request,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::scripted::{Notes, ScriptedWorld, abandon, assert_has, fact, pursue, run, task};

#[test]
fn changed_fact_causes_replan_only_if_plan_becomes_infeasible() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(&task, 60, vec![(5, fact(&task, "(here key)", false))]);
    assert_eq!(told.plans, 1, "{:#?}", told.notes);
    // The cup was already brought, and is no longer at its place.
    let gone = [
        fact(&task, "(here cup)", false),
        fact(&task, "(have cup)", true),
    ];
    let told = run(&task, 60, gone.into_iter().map(|it| (5_i64, it)).collect());
    assert_has(&told, &["rest: goal-reached problem"]);
    assert_eq!(told.report.starts, 1, "{:#?}", told.notes);
}

#[test]
fn changed_number_affects_later_actions() {
    let task = task("", "(and (have book) (have cup))");
    let fluent = task.fluent_named("(charge)").expect("a correct test");
    let value = |value: i64| Event::Value {
        fluent,
        value: Rational::from(value),
    };
    let told = run(&task, 100, vec![(5, value(0)), (50, value(3))]);
    assert_has(
        &told,
        &[
            "rest: unsolvable-from-here problem",
            "50: plan",
            "50: start",
            "rest: goal-reached problem",
        ],
    );
}

#[test]
fn unreachable_goals_are_reported_and_new_goals_accepted() {
    let task = task("", "(have book)");
    let gone = fact(&task, "(here cup)", false);
    let script = vec![
        (20, gone),
        (30, pursue("cup", "(have cup)")),
        (40, abandon("cup")),
        (50, pursue("key", "(have key)")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "30: plan",
            "rest: unsolvable-from-here cup",
            "40: rest: no goals",
            "50: start (fetch r key)",
            "rest: goal-reached key",
        ],
    );
}

#[test]
fn events_end_idling_at_most_once_per_second() {
    let task = task("", "(and (have book) (have cup))");
    let at = |time: Rational, name: &str, truth: bool| (time, fact(&task, name, truth));
    let mut script = Vec::new();
    for (time, truth) in [(5, false), (30, true)] {
        let time = Rational::from(time);
        script.push(at(time.clone(), "(here book)", truth));
        script.push(at(time, "(here cup)", truth));
    }
    // An unrelated fact changes a hundred times in two seconds.
    script.extend((0..100).map(|n| at(Rational::new(1000 + n, 50), "(here key)", n % 2 == 1)));
    let told = run(&task, 60, script);
    assert_has(
        &told,
        &[
            "rest: unsolvable-from-here",
            "30: plan",
            "rest: goal-reached problem",
        ],
    );
    assert!(told.plans <= 8, "{} plans: {:#?}", told.plans, told.notes);
}

#[test]
fn invalid_request_is_ignored_with_a_remark() {
    let task = task("", "(have book)");
    let script = vec![
        (1, pursue("odd", "(have spoon)")),
        (2, abandon("odd")),
        (3, Event::Requested(Request::Resume)),
    ];
    let told = run(&task, 60, script);
    assert_has(
        &told,
        &[
            "1: it is not a valid goal of this problem",
            "2: there is no open goal with this name",
            "3: the run is not paused",
            "rest: goal-reached problem",
        ],
    );
    assert_eq!(told.plans, 1);
}

/// For any sequence of requests, nothing is started while the run is paused, nothing is started
/// twice at a time, and tickets are unique.
#[test]
fn random_requests_keep_run_consistent() {
    let task = task("(free s)", "(have book)");
    for seed in 0..60_u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut below = |limit: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % limit
        };
        let items = ["book", "cup", "key"];
        let mut script = Vec::new();
        let mut pauses = Vec::new();
        let mut paused_at = None;
        for time in 1..40 {
            let item = items[usize::try_from(below(3)).expect("small")];
            let event = match below(8) {
                0 | 1 => pursue(item, &format!("(have {item})")),
                2 => abandon(item),
                3 => fact(&task, &format!("(have {item})"), false),
                4 => fact(&task, &format!("(here {item})"), below(2) == 0),
                5 if paused_at.is_none() => {
                    paused_at = Some(time);
                    Event::Requested(Request::Pause)
                }
                6 => {
                    pauses.extend(paused_at.take().map(|from| (from, time)));
                    Event::Requested(Request::Resume)
                }
                _ => continue,
            };
            script.push((time, event));
        }
        pauses.extend(paused_at.map(|from| (from, 1000)));
        let told = run(&task, 80, script);
        assert_eq!(told.report.verdict, Verdict::Interrupted, "{seed}");
        let mut tickets: Vec<ActionHandle> = Vec::new();
        for done in &told.report.executed {
            let start = &done.step.start;
            for (from, to) in &pauses {
                let is_inside = *start > Rational::from(*from) && *start < Rational::from(*to);
                assert!(!is_inside, "{seed}: started in a pause: {:#?}", told.notes);
            }
            assert!(!tickets.contains(&done.ticket), "{seed}");
            tickets.push(done.ticket);
        }
        let spans = told.report.executed.iter().map(|it| {
            let end = &it.step.start + it.step.duration.clone().unwrap_or_default();
            let robot = it.step.action.name.split(' ').nth(1).unwrap_or_default();
            (robot, it.step.start.clone(), end)
        });
        let spans: Vec<_> = spans.collect();
        for (index, one) in spans.iter().enumerate() {
            for other in &spans[index + 1..] {
                let overlap = one.0 == other.0 && one.1 < other.2 && other.1 < one.2;
                assert!(
                    !overlap,
                    "{seed}: one robot does two things: {:#?}",
                    told.notes
                );
            }
        }
    }
}

/// Planner with the answers of the embedded planner and a planning time that depends on the time of
/// the world.
struct SlowPlanner(fn(&Rational) -> i64);

impl Planner for SlowPlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let answer = Embedded::default().plan(task, situation).answer;
        assert!(matches!(answer, PlanAnswer::Plan(_)));
        PlannerAnswer {
            seconds: Some(Rational::from((self.0)(&situation.time))),
            ..PlannerAnswer::from(answer)
        }
    }
}

/// Returns the starts of a run whose goals are requested at these times.
fn starts(planner: SlowPlanner, goals: &[(i64, &str, &str)], end: i64) -> Vec<(String, Rational)> {
    let task = task("", "(and)");
    let must_end = Arc::new(AtomicBool::new(false));
    let coming = goals.iter().map(|(time, name, goal)| Observation {
        time: Rational::from(*time),
        event: pursue(name, goal),
    });
    let mut world = ScriptedWorld {
        now: Rational::ZERO,
        coming: coming.collect(),
        end: Rational::from(end),
        stop_requested: Arc::clone(&must_end),
        slow: None,
        on_cancel: None,
    };
    let report = Execution::of(&task)
        .with_planner(planner)
        .recorded_by(Notes::default())
        .with_stop_check(move || must_end.load(Ordering::SeqCst))
        .persistent(true)
        .run_in(&mut world);
    let executed = report.executed.iter();
    executed
        .map(|it| (it.step.action.name.clone(), it.step.start.clone()))
        .collect()
}

#[test]
fn plan_for_outdated_goals_is_not_adopted() {
    let goals = [(10, "it", "(have cup)"), (12, "it", "(have key)")];
    let starts = starts(SlowPlanner(|_| 5), &goals, 60);
    let names: Vec<_> = starts.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["(fetch r key)"]);
}

/// One search took a hundred seconds. The next plan is made for an equally late start, but not all
/// of the following plans.
#[test]
fn one_long_search_does_not_delay_later_plans() {
    let goals = [
        (10, "one", "(have cup)"),
        (200, "two", "(have key)"),
        (400, "three", "(have book)"),
    ];
    let only_at_first = |now: &Rational| if *now < Rational::from(100) { 100 } else { 1 };
    let starts = starts(SlowPlanner(only_at_first), &goals, 600);
    let whole: Vec<_> = starts.iter().map(|(_, time)| time.to_decimal(0)).collect();
    assert_eq!(whole, ["110", "300", "450"], "{starts:?}");
}
