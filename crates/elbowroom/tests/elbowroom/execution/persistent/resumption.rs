//! Records that begin while a run is idle: the following decisions are the same as with the whole
//! record.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom::execute::Execution;
use elbowroom::execution::run::{RunPhase, RunSettings, RunSnapshot};
use elbowroom::execution::{ActionHandle, Ending, Entry, Event, Observation, Recorder, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::report::trace::{
    Line, Replay, ReplayPlanner, ReplayWorld, SnapshotLine, Stored, snapshot_text,
};

use super::scripted::{
    RandomNumbers, ScriptedWorld, SlowPlanner, abandon, fact, pursue, pursue_from, task,
};

/// Recorder of a run's lines, and of the possible rotations: the number of lines before each, and
/// its snapshot.
struct Tape<'a> {
    task: Arc<Task>,
    lines: &'a mut Vec<String>,
    rotations: &'a mut Vec<(usize, String)>,
}

impl Recorder for Tape<'_> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.lines.push(Line::of(&self.task, entry).text());
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        let stand = stand();
        if !matches!(stand.phase, RunPhase::Idle { .. }) || !stand.goals.open.is_empty() {
            return false;
        }
        let line = SnapshotLine::of(&self.task, &stand).expect("it rests");
        let snapshot = snapshot_text(&line);
        self.rotations.push((self.lines.len(), snapshot));
        false
    }
}

const ITEMS: [&str; 3] = ["book", "cup", "key"];

fn example_task() -> Arc<Task> {
    task(
        "(at 90 (not (power))) (at 130 (power)) (at 200 (= (charge) 3))",
        "(have book)",
    )
}

/// Returns random requests, changes by others, and reports about actions that have ended or never
/// existed.
fn script(task: &Task, dice: &mut RandomNumbers) -> Vec<Observation> {
    let fluent = task.fluent_named("(charge)").expect("a correct test");
    let mut script = Vec::new();
    for _ in 0..25 {
        let item = ITEMS[usize::try_from(dice.below(3)).expect("small")];
        let ticket = ActionHandle(dice.below(8));
        let event = match dice.below(12) {
            0..=3 => pursue(item, &format!("(have {item})")),
            4 => pursue_from(item, &format!("(have {item})"), dice.small(300), None),
            5 => abandon(item),
            6 => fact(task, &format!("(have {item})"), false),
            7 => fact(task, &format!("(here {item})"), dice.below(4) > 0),
            8 => Event::Value {
                fluent,
                value: Rational::from(i64::try_from(dice.below(4)).expect("small")),
            },
            9 => Event::Ended {
                ticket,
                ending: Ending::Failed {
                    why: "so they say".to_owned(),
                },
                measured: Vec::new(),
            },
            10 => Event::Requested(Request::Pause),
            _ => Event::Requested(Request::Resume),
        };
        let tenths = i64::try_from(dice.below(3000)).expect("small");
        let time = Rational::new(tenths, 10);
        script.push(Observation { time, event });
    }
    script
}

fn execution<'a>(task: &Arc<Task>, executor: &str) -> Execution<'a> {
    Execution::of(task)
        .by(executor.parse().expect("a registered one"))
        .with_settings(RunSettings::default())
        .persistent(true)
        .with_explanations()
}

/// Returns the lines of a run by a random script, and the possible rotations.
fn taped(executor: &str, seed: u64) -> (Vec<String>, Vec<(usize, String)>) {
    let task = example_task();
    let must_end = Arc::new(AtomicBool::new(false));
    let mut world = ScriptedWorld {
        now: Rational::ZERO,
        coming: script(&task, &mut RandomNumbers(seed)),
        end: Rational::from(320),
        stop_requested: Arc::clone(&must_end),
        slow: None,
        on_cancel: None,
    };
    let (mut lines, mut beginnings) = (Vec::new(), Vec::new());
    execution(&task, executor)
        .with_planner(SlowPlanner(seed))
        .recorded_by(Tape {
            task: Arc::clone(&task),
            lines: &mut lines,
            rotations: &mut beginnings,
        })
        .with_stop_check(move || must_end.load(Ordering::SeqCst))
        .run_in(&mut world);
    (lines, beginnings)
}

/// Whenever a run is idle without goals and without running actions, its record can be rotated. A
/// replay from there reproduces every following line, including the text of each reason.
#[test]
fn run_resumed_from_idle_snapshot_behaves_identically() {
    let header = r#"{"event":"header","format":"elbowroom-trace","version":1}"#;
    let (mut resumed, mut followed) = (0, 0);
    for (executor, seed) in ["guarded", "live", "stn", "fixed(50)"]
        .into_iter()
        .flat_map(|executor| (0..40).map(move |seed| (executor, seed)))
    {
        let (lines, beginnings) = taped(executor, seed);
        let mut last = 0;
        for (count, snapshot) in beginnings {
            // While the run remains idle, hardly anything changes.
            if count < last + 5 && last > 0 {
                continue;
            }
            last = count;
            let rest = lines[count..].join("\n");
            let stored = Stored::read(&format!("{header}\n{snapshot}\n{rest}\n")).expect("whole");
            let task = example_task();
            let snapshot = stored.snapshot().expect("a snapshot");
            let rested = snapshot.map(|it| it.restored(&task).expect("of this task"));
            assert!(rested.is_some(), "the snapshot is read");
            let mut replay = Replay::new(&stored, Arc::clone(&task));
            let interruption = replay.interruption();
            execution(&task, executor)
                .resume_from(rested)
                .with_planner(ReplayPlanner::new(&stored))
                .recorded_by(&mut replay)
                .with_stop_check(move || interruption.load(Ordering::SeqCst))
                .run_in(&mut ReplayWorld::new(&stored, &task));
            let (mut agreed, difference) = replay.outcome();
            if let Some(difference) = &difference {
                // The final report only contains the actions since then.
                let is_end = matches!(difference.stored, Line::Over(_));
                assert!(is_end, "{executor}, {seed}, after {count}: {difference:#?}");
                let (Line::Over(one), Line::Over(other)) =
                    (&difference.stored, &difference.replayed)
                else {
                    panic!("{difference:?}");
                };
                assert!(one.executed.ends_with(&other.executed));
                assert_eq!((one.starts, &one.time), (other.starts, &other.time));
                agreed += 1;
            }
            assert_eq!(agreed, lines.len() - count, "{executor}, {seed}");
            resumed += 1;
            let command = |line: &&String| line.contains("\"event\":\"command\"");
            followed += lines[count..].iter().filter(command).count();
        }
    }
    assert!(
        resumed > 500 && followed > 500,
        "{resumed} beginnings, {followed} commands after them"
    );
}

/// Members of snapshots in the earlier format. Records were only rotated while the run was idle
/// without goals.
const EARLIER: [&str; 15] = [
    "event",
    "now",
    "since",
    "started",
    "allowance",
    "answers",
    "answers_since",
    "timed",
    "group",
    "facts",
    "numbers",
    "facts_before",
    "numbers_before",
    "doubtful_facts",
    "doubtful_numbers",
];

/// Journals with snapshots of the earlier format can be resumed: the run is idle without goals, and
/// accepts the next one.
#[test]
fn snapshot_of_earlier_format_can_be_resumed() {
    let header = r#"{"event":"header","format":"elbowroom-trace","version":1}"#;
    let (_, beginnings) = taped("guarded", 1);
    let (_, snapshot) = beginnings.last().expect("it rested");
    let mut members: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(snapshot).expect("JSON");
    members.retain(|name, _| EARLIER.contains(&name.as_str()));
    assert_eq!(members.len(), EARLIER.len());
    let earlier = serde_json::to_string(&members).expect("JSON");
    let stored = Stored::read(&format!("{header}\n{earlier}\n")).expect("whole");
    let task = example_task();
    let line = stored.snapshot().expect("of the form").expect("there");
    let stand = line.restored(&task).expect("of this task");
    assert!(matches!(stand.phase, RunPhase::Idle { .. }) && stand.goals.open.is_empty());
    assert!(stand.starts.is_empty() && stand.started > 0 && !stand.is_paused);
    let (now, first) = (stand.belief.time().clone(), stand.started as u64);
    let must_end = Arc::new(AtomicBool::new(false));
    let at = |seconds: i64| &now + Rational::from(seconds);
    let there = |fact: &str| crate::execution::persistent::scripted::fact(&task, fact, true);
    let event = |seconds: i64, event: Event| Observation {
        time: at(seconds),
        event,
    };
    let mut world = ScriptedWorld {
        now: now.clone(),
        coming: vec![
            event(1, there("(power)")),
            event(1, there("(here key)")),
            event(1, fact(&task, "(have key)", false)),
            event(2, pursue("key", "(have key)")),
        ],
        end: at(100),
        stop_requested: Arc::clone(&must_end),
        slow: None,
        on_cancel: None,
    };
    let (mut lines, mut again) = (Vec::new(), Vec::new());
    let tape = Tape {
        task: Arc::clone(&task),
        lines: &mut lines,
        rotations: &mut again,
    };
    execution(&task, "guarded")
        .resume_from(stand)
        .recorded_by(tape)
        .with_stop_check(move || must_end.load(Ordering::SeqCst))
        .run_in(&mut world);
    let start = lines.iter().find(|it| it.contains("\"event\":\"command\""));
    let start = start.expect("it acts");
    assert!(start.contains("(fetch r key)"), "{start}");
    assert!(start.contains(&format!("\"ticket\":{first}")), "{start}");
    let is_reached = |it: &String| it.contains("\"resting\"") && it.contains("goal-reached");
    assert!(lines.iter().any(is_reached), "{lines:#?}");
}

/// A snapshot of another problem is rejected with a message.
#[test]
fn snapshot_of_another_problem_is_rejected() {
    let (_, beginnings) = taped("guarded", 1);
    let (_, snapshot) = beginnings.last().expect("it has rested");
    let header = r#"{"event":"header","format":"elbowroom-trace","version":1}"#;
    let read = |snapshot: &str| Stored::read(&format!("{header}\n{snapshot}\n"));
    let other = snapshot.replacen("(power)", "(steam)", 1);
    let stored = read(&other).expect("it can be read");
    let line = stored.snapshot().expect("a snapshot").expect("there");
    let error = line
        .restored(&example_task())
        .expect_err("there is no such fact");
    assert!(error.contains("no fact `(steam)`"), "{error}");
    let other = read(&snapshot.replacen("\"now\"", "\"then\"", 1)).expect("it can be read");
    assert_eq!(other.snapshot().expect_err("it has no time").line, 2);
}
