//! Planning in the background of a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom::execute::Execution;
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Event, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;

use crate::beside::{Beside, Told, assert_has, seconds, settings, told};
use crate::lasting::scripted::{abandon, fact, pursue, task};
use crate::meanwhile::{Fate, ITEMS, assert_in_order, assert_plays_back};
use crate::recorded::assert_as_recorded;
use crate::scene::irr;

fn execution<'a>(task: &Arc<Task>, executor: &str) -> Execution<'a> {
    Execution::of(task)
        .with_envelopes(irr())
        .by(executor.parse().expect("a registered one"))
        .with_settings(settings())
}

/// Makes a persistent run by `guarded`.
fn lasting(task: &Arc<Task>, end: i64, script: Vec<(i64, Event)>, planner: &Beside) -> Told {
    let script = script
        .into_iter()
        .map(|(time, event)| (seconds(time), event));
    let script = (end, script.collect());
    let execution = execution(task, "guarded").lasting(true);
    told(execution, task, script, planner, &[])
}

#[test]
fn the_running_plan_goes_on_while_one_is_made_for_a_goal_that_was_given() {
    let task = task("", "(and (have book) (have cup))");
    let planner = Beside::taking(&[seconds(1), seconds(12)]);
    let told = lasting(&task, 100, vec![(5, pursue("key", "(have key)"))], &planner);
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
    let desk = planner.desk();
    assert_eq!((desk.begun, desk.waited_for), (2, 0), "{:#?}", told.notes);
}

#[test]
fn search_ends_when_a_deadline_passes_behind_which_the_goal_is_out_of_reach() {
    let init = "(at 20 (not (here book))) (at 40 (not (power))) (at 60 (not (here key)))";
    let task = task(init, "(have cup)");
    let planner = Beside::taking(&[seconds(5000), seconds(1)]);
    let told = lasting(&task, 200, Vec::new(), &planner);
    // The book is not needed, but power is.
    assert_has(
        &told,
        &[
            "0: plan",
            "40: plan",
            "41: rest: unsolvable-from-here problem",
        ],
    );
    assert_eq!(planner.desk().begun, 2, "{:#?}", told.notes);
}

/// Steps of the new plan that the current one has executed meanwhile are not repeated.
#[test]
fn what_was_done_meanwhile_is_not_done_again() {
    let task = task("(free s)", "(and (have book) (have cup))");
    for search in [0, 1, 4, 9, 14, 30] {
        let planner = Beside::taking(&[seconds(0), seconds(search)]);
        let script = vec![(2, pursue("key", "(have key)"))];
        let told = lasting(&task, 200, script, &planner);
        assert_has(&told, &["rest: goal-reached"]);
        assert_eq!(told.report.starts, 3, "{search}: {:#?}", told.notes);
    }
}

#[test]
fn goals_and_facts_that_come_in_during_a_search_are_taken_in_at_once() {
    let task = task("", "(have book)");
    let planner = Beside::taking(&[seconds(30), seconds(1)]);
    let script = vec![
        (3, pursue("odd", "(have spoon)")),
        (4, pursue("key", "(have key)")),
        (5, fact(&task, "(here cup)", false)),
        (6, Event::Asked(Request::Pause)),
        (7, Event::Asked(Request::Resume)),
    ];
    let told = lasting(&task, 100, script, &planner);
    assert_has(
        &told,
        &[
            "3: it is no goal of this problem",
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
fn where_the_plan_is_lost_nothing_is_started_until_there_is_another_one() {
    let task = task("(free s)", "(and (have book) (have cup) (have key))");
    let planner = Beside::taking(&[seconds(0), seconds(20)]);
    // All items that are not fetched yet are removed and returned.
    let here = |item: &str, truth| fact(&task, &format!("(here {item})"), truth);
    let gone = ITEMS.map(|item| (2, here(item, false)));
    let back = ITEMS.map(|item| (3, here(item, true)));
    let script = gone.into_iter().chain(back).collect();
    let told = lasting(&task, 100, script, &planner);
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
fn a_pause_during_a_search_holds_its_plan_back() {
    let task = task("", "(have book)");
    let planner = Beside::taking(&[seconds(10)]);
    let script = vec![
        (5, Event::Asked(Request::Pause)),
        (30, Event::Asked(Request::Resume)),
    ];
    let told = lasting(&task, 100, script, &planner);
    assert_has(
        &told,
        &["30: the plan is there", "30: start", "rest: goal-reached"],
    );
    assert_eq!(planner.desk().begun, 1);
}

#[test]
fn a_search_for_a_goal_that_is_abandoned_ends_and_one_without_goals_is_needless() {
    let task = task("", "(have book)");
    let planner = Beside::taking(&[seconds(0), seconds(1000), seconds(1)]);
    let script = vec![
        (2, pursue("key", "(have key)")),
        (4, abandon("key")),
        (30, pursue("cup", "(have cup)")),
        (31, abandon("cup")),
    ];
    let told = lasting(&task, 100, script, &planner);
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
    let desk = planner.desk();
    assert_eq!((desk.begun, desk.given_up), (4, 1), "{:#?}", told.notes);
}

/// The run acts even if goals are added or abandoned faster than plans can be made.
#[test]
fn goals_that_change_faster_than_plans_are_made_do_not_starve_the_run() {
    let task = task("", "(have book)");
    for comes_and_goes in [false, true] {
        let planner = Beside::taking(&[seconds(7)]);
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
        let told = lasting(&task, 200, script, &planner);
        let first = told.notes.iter().position(|it| it.contains("start (fetch"));
        let last_goal = told.notes.iter().position(|it| it.starts_with("60"));
        assert!(first.is_some(), "{:#?}", told.notes);
        assert!(
            last_goal.is_none_or(|last| first < Some(last)),
            "{:#?}",
            told.notes
        );
        assert_has(&told, &["rest: goal-reached"]);
        assert!(planner.desk().begun < 30, "{}", planner.desk().begun);
    }
}

/// A search for abandoned goals continues if goals change often. It may never end, and is stopped
/// after five seconds.
#[test]
fn a_search_for_abandoned_goals_is_not_let_go_on_for_ever() {
    let task = task("", "(have book)");
    let endless = seconds(1_000_000);
    let lengths = [&[seconds(0)][..], &vec![endless; 4], &[seconds(1)]].concat();
    let planner = Beside::taking(&lengths);
    let goals = ["key", "cup", "key", "cup", "key"].into_iter();
    let goals = goals.map(|item| pursue("key", &format!("(have {item})")));
    let told = lasting(&task, 100, (1..).zip(goals).collect(), &planner);
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
    let desk = planner.desk();
    assert_eq!((desk.begun, desk.given_up), (6, 4), "{:#?}", told.notes);
}

#[test]
fn a_run_that_finds_no_plan_rests_and_one_that_is_over_ends() {
    let task = task("", "(and (have book) (have cup))");
    let planner = Beside::taking(&[seconds(5)]);
    planner.desk().has_none = true;
    let told = lasting(&task, 100, Vec::new(), &planner);
    assert_has(
        &told,
        &["5: the plan is there", "rest: unsolvable-from-here problem"],
    );
    // A run with one goal waits for its first plan, and makes others in the background.
    let script = vec![
        (seconds(3), fact(&task, "(here cup)", false)),
        (seconds(4), fact(&task, "(here cup)", true)),
    ];
    let planner = Beside::taking(&[seconds(4)]);
    let script = (100, script);
    let told = told_once(&task, script, &planner);
    assert_eq!(
        told.report.verdict,
        Verdict::GoalReached,
        "{:#?}",
        told.notes
    );
    assert_eq!(planner.desk().waited_for, 1);
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

fn told_once(task: &Arc<Task>, script: (i64, Vec<(Rational, Event)>), planner: &Beside) -> Told {
    told(execution(task, "guarded"), task, script, planner, &[])
}

/// The new plan is infeasible when it arrives, while the current plan continues. It is outdated,
/// and planning is repeated at most twice before the executor stops starting actions.
#[test]
fn a_plan_that_is_outdated_when_it_comes_is_made_again() {
    let task = task("", "(and (have book) (have cup))");
    let planner = Beside::taking(&[seconds(0), seconds(6), seconds(6)]);
    let script = vec![
        (2, pursue("key", "(have key)")),
        (5, fact(&task, "(here key)", false)),
        (9, fact(&task, "(here key)", true)),
    ];
    let told = lasting(&task, 200, script, &planner);
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
fn whatever_happens_meanwhile_what_is_done_is_valid_and_plays_back() {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let mut records = Vec::new();
    for seed in 0..240 {
        let executor =
            ["guarded", "live", "stn", "adaptable"][usize::try_from(seed % 4).expect("small")];
        let task = task("(free s)", "(have book)");
        let fate = Fate::of(&task, seed);
        let planner = Beside::taking(&fate.lengths);
        let told = told(
            execution(&task, executor).lasting(true),
            &task,
            (400, fate.script),
            &planner,
            &fate.quarters,
        );
        let about = (seed, executor);
        assert_in_order(&task, &told, about);
        assert_eq!(planner.desk().waited_for, 0);
        for (what, note) in [("kept", "is kept"), ("start", "start")] {
            let notes = told.notes.iter().filter(|it| it.contains(note));
            *seen.entry(what).or_default() += notes.count();
        }
        *seen.entry("given up").or_default() += planner.desk().given_up;
        let again = execution(&task, executor).lasting(true);
        assert_plays_back(&task, &told, again, about);
        records.push(told.lines);
    }
    assert_as_recorded("aside", &records);
    for (what, count) in &seen {
        assert!(*count > 10, "{what}: {seen:?}");
    }
}
