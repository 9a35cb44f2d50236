//! Preparation of plans in the background of a run, by a preparer that takes a given time of the
//! world.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom::execute::{Execution, PlanPreparer};
use elbowroom::execution::run::RunSettings;
use elbowroom::execution::{Event, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::report::trace::ReplayPreparer;

use crate::execution::background_planner::{
    RunResult, ScriptedBackgroundPlanner, ScriptedBackgroundPreparer, assert_has, run_recorded,
    seconds, settings,
};
use crate::execution::persistent::scripted::{RandomNumbers, abandon, fact, pursue, task};
use crate::execution::random_events::{RandomScript, assert_in_order, assert_plays_back, is_start};
use crate::execution::recorded::assert_as_recorded;
use crate::execution::scene::irr;

fn execution<'a>(task: &Arc<Task>, executor: &str) -> Execution<'a> {
    let settings = RunSettings {
        prepares_in_background: true,
        ..settings()
    };
    Execution::of(task)
        .with_envelopes(irr())
        .by(executor.parse().expect("a registered one"))
        .with_settings(settings)
        .persistent(true)
}

/// Makes a run by `guarded`.
fn run(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(i64, Event)>,
    planner: &ScriptedBackgroundPlanner,
) -> RunResult {
    let script = script.into_iter();
    let script = script.map(|(time, event)| (seconds(time), event));
    let execution = execution(task, "guarded")
        .with_preparer(ScriptedBackgroundPreparer(planner.clone(), irr()));
    run_recorded(execution, task, (end, script.collect()), planner, &[])
}

/// During the preparation of the new plan, the current plan starts committed actions, which
/// continue in the new plan.
#[test]
fn action_started_during_preparation_is_part_of_new_plan() {
    let task = task("", "(and (have book) (have cup))");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(0), seconds(4)]);
    let planner = planner.with_preparation_times(&[seconds(0), seconds(20)]);
    let script = vec![(2, pursue("key", "(have key)"))];
    let told = run(&task, 100, script, &planner);
    assert_has(
        &told,
        &[
            "0: start",
            "2: plan",
            "6: the plan is there",
            // The executor of the first plan starts it, and the second job is part of both plans.
            "10: start",
            "26: start (fetch r key)",
            "36: rest: goal-reached",
        ],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
}

/// The current plan starts no actions that the new plan does not contain.
#[test]
fn action_missing_in_new_plan_is_not_started() {
    let task = task("", "(have book)");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(0), seconds(4)]);
    let planner = planner.with_preparation_times(&[seconds(0), seconds(20)]);
    let script = vec![
        (1, pursue("cup", "(have cup)")),
        (2, abandon("problem")),
        (3, abandon("cup")),
        (4, pursue("key", "(have key)")),
    ];
    let told = run(&task, 100, script, &planner);
    assert_has(&told, &["0: start (fetch r book)", "rest: goal-reached"]);
    assert_eq!(told.report.starts, 2, "{:#?}", told.notes);
}

/// Requests and reports during the preparation are processed at once.
#[test]
fn requests_during_preparation_are_handled_at_once() {
    let task = task("", "(have book)");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(1)])
        .with_preparation_times(&[seconds(30)]);
    let script = vec![
        (3, pursue("odd", "(have spoon)")),
        (4, pursue("key", "(have key)")),
        (5, fact(&task, "(here cup)", false)),
        (6, Event::Requested(Request::Pause)),
        (7, Event::Requested(Request::Resume)),
    ];
    let told = run(&task, 200, script, &planner);
    assert_has(&told, &["3: it is not a valid goal", "rest: goal-reached"]);
    let place = |what: &str| told.lines.iter().position(|it| it.contains(what));
    let taken_up = place("\"event\":\"plan\"");
    assert!(taken_up.is_some());
    for what in ["goal", "fact", "pause", "resume"] {
        let taken = place(&format!("\"observation\":{{\"type\":\"{what}\""));
        assert!(taken.is_some() && taken < taken_up, "{what}: {taken:?}");
    }
}

/// The run acts even if unexpected events occur all the time: after two more attempts, the executor
/// gets the plan.
#[test]
fn frequent_events_do_not_starve_the_run() {
    let task = task("", "(and (have book) (have cup))");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(1)])
        .with_preparation_times(&[seconds(5)]);
    let script = (1..90).map(|second| (second, fact(&task, "(here key)", second % 2 == 0)));
    let told = run(&task, 200, script.collect(), &planner);
    assert_has(
        &told,
        &["1: the plan is there", "16: start", "26: start", "36: rest"],
    );
    assert_eq!(planner.state().preparations, 3, "{:#?}", told.notes);
}

/// The remaining plan is prepared for an added goal while it is executed.
#[test]
fn kept_plan_continues_during_preparation() {
    let task = task("", "(and (have book) (have cup))");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(0)])
        .with_preparation_times(&[seconds(0), seconds(15)]);
    let script = vec![(2, pursue("too", "(have cup)"))];
    let told = run(&task, 100, script, &planner);
    assert_has(
        &told,
        &[
            "0: start",
            "10: start",
            "17: the plan is kept",
            "20: rest: goal-reached problem too",
        ],
    );
    assert_eq!(planner.state().started_searches, 1);
}

const EXECUTORS: [&str; 6] = [
    "guarded",
    "live",
    "stn",
    "adaptable",
    "esterel",
    "fixed(50)",
];

fn executor(seed: u64) -> &'static str {
    EXECUTORS[usize::try_from(seed % 6).expect("small")]
}

/// Runs a random script with these preparation times.
fn random_run(
    task: &Arc<Task>,
    seed: u64,
    readying: &dyn Fn(&mut RandomNumbers) -> Vec<Rational>,
) -> (RunResult, ScriptedBackgroundPlanner) {
    let RandomScript {
        script,
        lengths,
        quarters,
        mut dice,
    } = RandomScript::draw(task, seed);
    let planner = ScriptedBackgroundPlanner::with_planning_times(&lengths)
        .with_preparation_times(&readying(&mut dice));
    let execution = execution(task, executor(seed))
        .with_preparer(ScriptedBackgroundPreparer(planner.clone(), irr()));
    let told = run_recorded(execution, task, (500, script), &planner, &quarters);
    (told, planner)
}

/// A preparation in the background that takes no time has the same result as one in the foreground,
/// except the report that the plan is ready.
#[test]
fn immediate_and_synchronous_preparation_agree() {
    let (mut ready, mut records) = (0, Vec::new());
    for seed in 0..120 {
        let task = || task("(free s)", "(have book)");
        let (waited_for, _) = random_run(&task(), seed, &|_| Vec::new());
        let (beside, _) = random_run(&task(), seed, &|_| vec![seconds(0)]);
        let is_said = |line: &&String| line.contains("\"plan-ready\"");
        ready += beside.lines.iter().filter(is_said).count();
        let plain = |told: &RunResult| -> Vec<String> {
            let lines = told.lines.iter().filter(|it| !is_said(it));
            lines.cloned().collect()
        };
        assert_eq!(plain(&beside), plain(&waited_for), "{seed}");
        records.push(waited_for.lines);
    }
    assert_as_recorded("waited-for", &records);
    assert!(ready > 500, "{ready}");
}

/// For all requests, events, planning times and preparation times, the validator accepts the
/// execution, nothing is started in a pause, the goals are reached in the end, and the record
/// replays with the same decisions.
#[test]
fn random_events_during_preparation_keep_run_valid_and_replayable() {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let mut records = Vec::new();
    for seed in 0..420 {
        let slowly = |dice: &mut RandomNumbers| -> Vec<Rational> {
            (0..16)
                .map(|_| Rational::new(dice.small(160), 10))
                .collect()
        };
        let (task, executor) = (task("(free s)", "(have book)"), executor(seed));
        let (told, planner) = random_run(&task, seed, &slowly);
        let about = (seed, executor);
        assert_in_order(&task, &told, about);
        let mut is_ready = true;
        for line in &told.lines {
            is_ready &= !line.contains("\"event\":\"planned\"");
            is_ready |= line.contains("\"event\":\"plan\"");
            *seen.entry("begun meanwhile").or_default() += usize::from(is_start(line) && !is_ready);
        }
        for (what, note) in [("kept", "is kept"), ("outdated", "events during planning")] {
            let notes = told.notes.iter().filter(|it| it.contains(note));
            *seen.entry(what).or_default() += notes.count();
        }
        *seen.entry("readied").or_default() += planner.state().preparations;
        let preparer = ReplayPreparer(PlanPreparer::new(irr()));
        let again = execution(&task, executor).with_preparer(preparer);
        assert_plays_back(&task, &told, again, about);
        records.push(told.lines);
    }
    assert_as_recorded("readying", &records);
    for (what, count) in &seen {
        assert!(*count > 10, "{what}: {seen:?}");
    }
}
