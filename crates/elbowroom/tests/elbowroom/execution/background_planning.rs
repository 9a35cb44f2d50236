//! Planning in the background of a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom::execute::Execution;
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Event, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;

use crate::execution::background_planner::{
    RunResult, ScriptedBackgroundPlanner, assert_has, run_recorded, seconds, settings,
};
use crate::execution::persistent::scripted::{abandon, fact, pursue, task};
use crate::execution::random_events::{ITEMS, RandomScript, assert_in_order, assert_plays_back};
use crate::execution::recorded::assert_as_recorded;
use crate::execution::scene::irr;

fn execution<'a>(task: &Arc<Task>, executor: &str) -> Execution<'a> {
    Execution::of(task)
        .with_envelopes(irr())
        .by(executor.parse().expect("a registered one"))
        .with_settings(settings())
}

/// Makes a persistent run by `guarded`.
fn run_persistent(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(i64, Event)>,
    planner: &ScriptedBackgroundPlanner,
) -> RunResult {
    let script = script
        .into_iter()
        .map(|(time, event)| (seconds(time), event));
    let script = (end, script.collect());
    let execution = execution(task, "guarded").persistent(true);
    run_recorded(execution, task, script, planner, &[])
}

#[test]
fn current_plan_continues_during_planning_for_new_goal() {
    let task = task("", "(and (have book) (have cup))");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(1), seconds(12)]);
    let told = run_persistent(&task, 100, vec![(5, pursue("key", "(have key)"))], &planner);
    // The first plan is made in the first second; the second job begins during the second search,
    // and the third after it.
    assert_has(
        &told,
        &[
            "1: the plan is there",
            "1: start",
            "5: plan",
            "11: start",
            "17: the plan is there",
            "21: start (fetch r key)",
            "rest: goal-reached",
        ],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
    let desk = planner.state();
    assert_eq!(
        (desk.started_searches, desk.awaited_searches),
        (2, 0),
        "{:#?}",
        told.notes
    );
}

#[test]
fn search_ends_at_deadline_that_makes_goal_unreachable() {
    let init = "(at 20 (not (here book))) (at 40 (not (power))) (at 60 (not (here key)))";
    let task = task(init, "(have cup)");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(5000), seconds(1)]);
    let told = run_persistent(&task, 200, Vec::new(), &planner);
    // The book is not needed, but power is.
    assert_has(
        &told,
        &[
            "0: plan",
            "40: plan",
            "41: rest: unsolvable-from-here problem",
        ],
    );
    assert_eq!(planner.state().started_searches, 2, "{:#?}", told.notes);
}

/// Steps of the new plan that the current one has executed meanwhile are not repeated.
#[test]
fn actions_done_during_planning_are_not_repeated() {
    let task = task("(free s)", "(and (have book) (have cup))");
    for search in [0, 1, 4, 9, 14, 30] {
        let planner =
            ScriptedBackgroundPlanner::with_planning_times(&[seconds(0), seconds(search)]);
        let script = vec![(2, pursue("key", "(have key)"))];
        let told = run_persistent(&task, 200, script, &planner);
        assert_has(&told, &["rest: goal-reached"]);
        assert_eq!(told.report.starts, 3, "{search}: {:#?}", told.notes);
    }
}

#[test]
fn requests_during_search_are_handled_at_once() {
    let task = task("", "(have book)");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(30), seconds(1)]);
    let script = vec![
        (3, pursue("odd", "(have spoon)")),
        (4, pursue("key", "(have key)")),
        (5, fact(&task, "(here cup)", false)),
        (6, Event::Requested(Request::Pause)),
        (7, Event::Requested(Request::Resume)),
    ];
    let told = run_persistent(&task, 100, script, &planner);
    assert_has(
        &told,
        &[
            "3: it is not a valid goal of this problem",
            "30: the plan is there",
            "30: plan, because the goals have changed",
            "30: start (fetch r book)",
            "rest: goal-reached",
        ],
    );
    // All events were processed before there was a plan.
    let place = |what: &str| told.lines.iter().position(|it| it.contains(what));
    let there = place("\"event\":\"planned\"");
    for what in ["goal", "fact", "pause", "resume"] {
        let taken = place(&format!("\"observation\":{{\"type\":\"{what}\""));
        assert!(
            taken.is_some() && taken < there,
            "{what}: {taken:?}, {there:?}"
        );
    }
    assert_eq!(told.report.starts, 2, "{:#?}", told.notes);
}

#[test]
fn no_action_starts_after_plan_is_lost_until_replanning() {
    let task = task("(free s)", "(and (have book) (have cup) (have key))");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(0), seconds(20)]);
    // All items that are not fetched yet are removed and returned.
    let here = |item: &str, truth| fact(&task, &format!("(here {item})"), truth);
    let gone = ITEMS.map(|item| (2, here(item, false)));
    let back = ITEMS.map(|item| (3, here(item, true)));
    let script = gone.into_iter().chain(back).collect();
    let told = run_persistent(&task, 100, script, &planner);
    assert_has(
        &told,
        &[
            "0: start",
            "2: plan",
            // The item was missing in the situation of the search, but is available again.
            "22: the plan is there",
            "22: plan",
            "42: the plan is there",
            "rest: goal-reached",
        ],
    );
    let early = told.notes.iter().filter(|it| it.contains("start"));
    let before = |it: &&String| it.split(':').next().and_then(|it| it.parse().ok()) < Some(42.0);
    assert_eq!(early.filter(before).count(), 2, "{:#?}", told.notes);
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
}

#[test]
fn pause_during_search_delays_adoption() {
    let task = task("", "(have book)");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(10)]);
    let script = vec![
        (5, Event::Requested(Request::Pause)),
        (30, Event::Requested(Request::Resume)),
    ];
    let told = run_persistent(&task, 100, script, &planner);
    assert_has(
        &told,
        &["30: the plan is there", "30: start", "rest: goal-reached"],
    );
    assert_eq!(planner.state().started_searches, 1);
}

#[test]
fn abandoned_goal_ends_its_search() {
    let task = task("", "(have book)");
    let planner =
        ScriptedBackgroundPlanner::with_planning_times(&[seconds(0), seconds(1000), seconds(1)]);
    let script = vec![
        (2, pursue("key", "(have key)")),
        (4, abandon("key")),
        (30, pursue("cup", "(have cup)")),
        (31, abandon("cup")),
    ];
    let told = run_persistent(&task, 100, script, &planner);
    assert_has(
        &told,
        &[
            "2: plan",
            "4: plan",
            "rest: goal-reached problem",
            "31: rest: no goals",
        ],
    );
    // The last plan arrives when its goal is abandoned, so there is no open request to abandon.
    let desk = planner.state();
    assert_eq!(
        (desk.started_searches, desk.abandoned_searches),
        (4, 1),
        "{:#?}",
        told.notes
    );
}

/// The run acts even if goals are added or abandoned faster than plans can be made.
#[test]
fn frequent_goal_changes_do_not_starve_the_run() {
    let task = task("", "(have book)");
    for comes_and_goes in [false, true] {
        let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(7)]);
        let mut script = Vec::new();
        for second in 1..60 {
            script.push((
                second,
                match second % 2 {
                    1 => pursue("cup", "(have cup)"),
                    _ if comes_and_goes => abandon("cup"),
                    _ => pursue("key", "(have key)"),
                },
            ));
        }
        let told = run_persistent(&task, 200, script, &planner);
        let first = told.notes.iter().position(|it| it.contains("start (fetch"));
        let last_goal = told.notes.iter().position(|it| it.starts_with("60"));
        assert!(first.is_some(), "{:#?}", told.notes);
        assert!(
            last_goal.is_none_or(|last| first < Some(last)),
            "{:#?}",
            told.notes
        );
        assert_has(&told, &["rest: goal-reached"]);
        assert!(
            planner.state().started_searches < 30,
            "{}",
            planner.state().started_searches
        );
    }
}

/// A search for abandoned goals continues if goals change often. It may never end, and is stopped
/// after five seconds.
#[test]
fn search_for_abandoned_goals_ends() {
    let task = task("", "(have book)");
    let endless = seconds(1_000_000);
    let lengths = [&[seconds(0)][..], &vec![endless; 4], &[seconds(1)]].concat();
    let planner = ScriptedBackgroundPlanner::with_planning_times(&lengths);
    let goals = ["key", "cup", "key", "cup", "key"].into_iter();
    let goals = goals.map(|item| pursue("key", &format!("(have {item})")));
    let told = run_persistent(&task, 100, (1..).zip(goals).collect(), &planner);
    assert_has(
        &told,
        &[
            "4: plan",
            // The fourth search has run for five seconds.
            "9: plan",
            "10: the plan is there",
            "rest: goal-reached key",
        ],
    );
    let desk = planner.state();
    assert_eq!(
        (desk.started_searches, desk.abandoned_searches),
        (6, 4),
        "{:#?}",
        told.notes
    );
}

#[test]
fn run_without_plan_is_idle_and_finished_run_ends() {
    let task = task("", "(and (have book) (have cup))");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(5)]);
    planner.state().has_none = true;
    let told = run_persistent(&task, 100, Vec::new(), &planner);
    assert_has(
        &told,
        &["5: the plan is there", "rest: unsolvable-from-here problem"],
    );
    // A run with one goal waits for its first plan, and makes others in the background.
    let script = vec![
        (seconds(3), fact(&task, "(here cup)", false)),
        (seconds(4), fact(&task, "(here cup)", true)),
    ];
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(4)]);
    let script = (100, script);
    let told = run_with_one_plan(&task, script, &planner);
    assert_eq!(
        told.report.verdict,
        Verdict::GoalReached,
        "{:#?}",
        told.notes
    );
    assert_eq!(planner.state().awaited_searches, 1);
    assert_has(
        &told,
        &[
            "0: start",
            "3: plan",
            "7: plan",
            "11: the plan is there",
            "11: start (fetch r cup)",
        ],
    );
}

fn run_with_one_plan(
    task: &Arc<Task>,
    script: (i64, Vec<(Rational, Event)>),
    planner: &ScriptedBackgroundPlanner,
) -> RunResult {
    run_recorded(execution(task, "guarded"), task, script, planner, &[])
}

/// The new plan is infeasible when it arrives, while the current plan continues. It is outdated,
/// and planning is repeated at most twice before the executor stops starting actions.
#[test]
fn outdated_plan_is_replaced() {
    let task = task("", "(and (have book) (have cup))");
    let planner =
        ScriptedBackgroundPlanner::with_planning_times(&[seconds(0), seconds(6), seconds(6)]);
    let script = vec![
        (2, pursue("key", "(have key)")),
        (5, fact(&task, "(here key)", false)),
        (9, fact(&task, "(here key)", true)),
    ];
    let told = run_persistent(&task, 200, script, &planner);
    assert_has(
        &told,
        &[
            "0: start (fetch r book)",
            "2: plan",
            "8: the plan is there",
            "8: plan, because events during planning",
            "10: start (fetch r cup)",
            "14: the plan is there",
            "rest: goal-reached key",
        ],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
}

/// For all requests, planning times and deviations, the validator accepts the execution, nothing is
/// started while the run is paused, and the record replays with the same decisions.
#[test]
fn random_events_during_planning_keep_run_valid_and_replayable() {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let mut records = Vec::new();
    for seed in 0..240 {
        let executor =
            ["guarded", "live", "stn", "adaptable"][usize::try_from(seed % 4).expect("small")];
        let task = task("(free s)", "(have book)");
        let fate = RandomScript::draw(&task, seed);
        let planner = ScriptedBackgroundPlanner::with_planning_times(&fate.lengths);
        let told = run_recorded(
            execution(&task, executor).persistent(true),
            &task,
            (400, fate.script),
            &planner,
            &fate.quarters,
        );
        let about = (seed, executor);
        assert_in_order(&task, &told, about);
        assert_eq!(planner.state().awaited_searches, 0);
        for (what, note) in [("kept", "is kept"), ("start", "start")] {
            let notes = told.notes.iter().filter(|it| it.contains(note));
            *seen.entry(what).or_default() += notes.count();
        }
        *seen.entry("given up").or_default() += planner.state().abandoned_searches;
        let again = execution(&task, executor).persistent(true);
        assert_plays_back(&task, &told, again, about);
        records.push(told.lines);
    }
    assert_as_recorded("aside", &records);
    for (what, count) in &seen {
        assert!(*count > 10, "{what}: {seen:?}");
    }
}
