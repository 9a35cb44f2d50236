//! Random requests and events during planning or preparation in the background, and the invariants
//! of all such runs.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use elbowroom::execute::Execution;
use elbowroom::execution::{Event, Request};
use elbowroom::model::validate::{Settings, validate};
use elbowroom::model::{Step, Task, TimeTriggeredPlan, problem};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Replay, ReplayPlanner, ReplayWorld, Stored};

use crate::execution::background_planner::{RunResult, seconds};
use crate::execution::persistent::scripted::{RandomNumbers, abandon, fact, pursue};

/// Items that can be fetched.
pub(crate) const ITEMS: [&str; 3] = ["book", "cup", "key"];

/// Random choices of a run.
pub(crate) struct RandomScript {
    pub(crate) script: Vec<(Rational, Event)>,
    /// Planning times.
    pub(crate) lengths: Vec<Rational>,
    /// Deviations of durations, in quarters.
    pub(crate) quarters: Vec<i64>,
    /// Random numbers for further choices.
    pub(crate) dice: RandomNumbers,
}

impl RandomScript {
    /// Draws goals that are added and abandoned, pauses, and, with odd seeds, items that are taken
    /// away. The script ends with a reachable goal called `last`.
    pub(crate) fn draw(task: &Task, seed: u64) -> Self {
        let mut dice = RandomNumbers(seed);
        let mut script = Vec::new();
        for _ in 0..20 {
            let item = ITEMS[usize::try_from(dice.below(3)).expect("small")];
            let event = match dice.below(10) {
                0..=5 => pursue(item, &format!("(have {item})")),
                6..=7 => abandon(item),
                8 => Event::Requested(Request::Pause),
                _ => Event::Requested(Request::Resume),
            };
            script.push((Rational::new(dice.small(600), 10), event));
        }
        // Items are taken away and returned in every other run. The validator cannot check a plan
        // with changes by others.
        for _ in 0..(seed % 2) * 6 {
            let item = ITEMS[usize::try_from(dice.below(3)).expect("small")];
            let here = fact(task, &format!("(here {item})"), dice.below(2) == 0);
            script.push((Rational::new(dice.small(600), 10), here));
        }
        for item in ITEMS {
            script.push((seconds(61), fact(task, &format!("(here {item})"), true)));
        }
        // The run always resumes in the end.
        script.push((seconds(61), Event::Requested(Request::Resume)));
        script.push((seconds(62), pursue("last", "(and (have book) (have key))")));
        let lengths = (0..12).map(|_| Rational::new(dice.small(150), 10));
        let lengths = lengths.collect();
        let quarters = (0..7).map(|_| dice.small(3) - 1).collect();
        Self {
            script,
            lengths,
            quarters,
            dice,
        }
    }
}

/// Checks that the last goal was reached, that nothing was started in a pause, and that the
/// validator accepts the execution, unless others have changed facts. `name` identifies the run.
pub(crate) fn assert_in_order(task: &Task, told: &RunResult, (seed, name): (u64, &str)) {
    let notes = &told.notes;
    let is_last = |it: &String| {
        it.contains("rest: goal-reached") && it.contains("last") || it.contains("`last` achieved")
    };
    assert!(notes.iter().any(is_last), "{name}, {seed}: {notes:#?}");
    let executed = told.report.executed.iter();
    let steps: Vec<Step> = executed.map(|it| it.step.clone()).collect();
    let free = task.with_goal(problem::Condition::TRUE);
    let verdict = validate(&free, &TimeTriggeredPlan { steps }, &Settings::default());
    assert!(
        verdict.is_valid() || seed % 2 == 1,
        "{name}, {seed}: {verdict:?} {notes:#?}"
    );
    let mut is_paused = false;
    for line in &told.lines {
        if line.contains("\"event\":\"observed\"") {
            is_paused |= line.contains("\"type\":\"pause\"");
            is_paused &= !line.contains("\"type\":\"resume\"");
        }
        assert!(!(is_start(line) && is_paused), "{name}, {seed}: {line}");
    }
}

/// Returns `true` if a line of a record is a start command.
pub(crate) fn is_start(line: &str) -> bool {
    line.contains("\"event\":\"command\"") && line.contains("\"type\":\"start\"")
}

/// Checks that an execution from the record has the same decisions as the original one.
pub(crate) fn assert_plays_back(
    task: &Arc<Task>,
    told: &RunResult,
    execution: Execution<'_>,
    (seed, name): (u64, &str),
) {
    let header = r#"{"event":"header","format":"elbowroom-trace","version":1}"#;
    let text = format!("{header}\n{}\n", told.lines.join("\n"));
    let stored = Stored::read(&text).expect("whole");
    let mut replay = Replay::new(&stored, Arc::clone(task));
    let interruption = replay.interruption();
    execution
        .with_planner(ReplayPlanner::new(&stored))
        .recorded_by(&mut replay)
        .with_stop_check(move || interruption.load(Ordering::SeqCst))
        .run_in(&mut ReplayWorld::new(&stored, task));
    let (agreed, difference) = replay.outcome();
    assert_eq!(difference, None, "{name}, {seed}");
    assert_eq!(agreed, told.lines.len(), "{name}, {seed}");
}
