//! Rotation of records in the middle of a run: the following decisions are the same as with the
//! whole record.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use elbowroom::execute::{Execution, PlanPreparer};
use elbowroom::execution::run::{RunPhase, RunSettings, RunSnapshot};
use elbowroom::execution::{ActionHandle, Ending, Entry, Event, Recorder, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::report::trace::{
    Line, Replay, ReplayPlanner, ReplayPreparer, ReplayWorld, SnapshotLine, Stored, snapshot_text,
};

use super::scripted::{RandomNumbers, SlowPlanner, abandon, fact, keep, pursue, pursue_from};
use crate::execution::background_planner::{
    ScriptedBackgroundPlanner, ScriptedBackgroundPreparer, announcing_world,
};
use crate::execution::scene::irr;

const HEADER: &str = r#"{"event":"header","format":"elbowroom-trace","version":1}"#;

/// Errands that consume charge, and whose effects depend on the lamp at their start and throughout.
const DOMAIN: &str =
    "(define (domain errands) (:requirements :durative-actions :typing :fluents :conditional-effects)
    (:types robot item)
    (:predicates (free ?r - robot) (here ?x - item) (have ?x - item) (power) (lamp) (seen ?x - item)
      (quiet))
    (:functions (charge))
    (:durative-action fetch :parameters (?r - robot ?x - item) :duration (= ?duration 10)
      :condition (and (at start (free ?r)) (at start (here ?x)) (at start (>= (charge) 1))
        (over all (power)))
      :effect (and (at start (not (free ?r))) (at end (free ?r)) (at end (have ?x))
        (when (at start (lamp)) (at end (seen ?x)))
        (when (over all (quiet)) (at end (here ?x))))))";

fn task(init: &str) -> Arc<Task> {
    let problem = format!(
        "(define (problem day) (:domain errands)
           (:objects r s - robot book cup key pen map - item)
           (:init (free r) (here book) (here cup) (here key) (here pen) (here map)
             (power) (= (charge) 9) (quiet) {init})
           (:goal (have book)))"
    );
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(DOMAIN), &source(&problem));
    Arc::new(Task::new(read.expect("a correct test").0))
}

const ITEMS: [&str; 5] = ["book", "cup", "key", "pen", "map"];

/// Returns random requests, changes by others, and reports about actions that have ended, never
/// existed, or end in another way than reported before.
fn script(task: &Task, dice: &mut RandomNumbers) -> Vec<(Rational, Event)> {
    let fluent = task.fluent_named("(charge)").expect("a correct test");
    let mut script = Vec::new();
    for _ in 0..70 {
        let item = ITEMS[usize::try_from(dice.below(5)).expect("small")];
        let ticket = ActionHandle(dice.below(12));
        let event = match dice.below(20) {
            0..=5 => pursue(item, &format!("(have {item})")),
            6 => pursue_from(item, &format!("(have {item})"), dice.small(240), None),
            7 => keep(item, &format!("(have {item})")),
            8 => abandon(item),
            9 | 10 => fact(task, &format!("(have {item})"), false),
            11 => fact(task, &format!("(here {item})"), dice.below(4) > 0),
            12 => fact(task, "(lamp)", dice.below(2) > 0),
            13 => fact(task, "(quiet)", dice.below(2) > 0),
            14 => fact(task, "(power)", dice.below(4) > 0),
            15 => Event::Value {
                fluent,
                value: Rational::from(dice.small(4)),
            },
            16 => Event::Ended {
                ticket,
                ending: Ending::Failed {
                    why: "so they say".to_owned(),
                },
                measured: Vec::new(),
            },
            17 => Event::Feedback {
                ticket,
                completion: None,
                note: "under way".to_owned(),
            },
            18 => Event::Requested(Request::Pause),
            _ => Event::Requested(Request::Resume),
        };
        script.push((Rational::new(dice.small(2400), 10), event));
    }
    script.push((Rational::from(241), Event::Requested(Request::Resume)));
    script
}

/// Segment of a record, with its initial snapshot.
#[derive(Default)]
struct Segment {
    snapshot: Option<String>,
    lines: Vec<String>,
}

/// Recorder that rotates at some of the possible times.
struct Rotating {
    task: Arc<Task>,
    segments: Arc<Mutex<Vec<Segment>>>,
    /// Probability of a rotation in percent, and its random numbers.
    percent: u64,
    dice: RandomNumbers,
}

impl Recorder for Rotating {
    fn record(&mut self, entry: &Entry<'_>) {
        let mut segments = self.segments.lock().expect("not poisoned");
        let last = segments.last_mut().expect("there is one");
        last.lines.push(Line::of(&self.task, entry).text());
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        // While the run is idle, there are many possible times.
        let is_at_rest = matches!(stand().phase, RunPhase::Idle { .. });
        if self.dice.below(100) >= self.percent || (is_at_rest && self.dice.below(6) > 0) {
            return false;
        }
        let snapshot = SnapshotLine::of(&self.task, &stand());
        let Some(snapshot) = snapshot else {
            return false;
        };
        self.segments.lock().expect("not poisoned").push(Segment {
            snapshot: Some(snapshot_text(&snapshot)),
            lines: Vec::new(),
        });
        true
    }
}

/// Run by a random script.
#[derive(Clone, Copy, Debug)]
struct Case {
    executor: &'static str,
    seed: u64,
    plans_in_background: bool,
    /// `true` if plans are also prepared in the background.
    prepares_in_background: bool,
}

impl Case {
    fn task(self) -> Arc<Task> {
        let init = [
            "(free s)",
            "(lamp)",
            "(free s) (lamp)",
            "(free s) (at 90 (not (power))) (at 130 (power))",
        ];
        task(init[usize::try_from(self.seed / 2 % 4).expect("small")])
    }

    fn execution<'a>(self, task: &Arc<Task>) -> Execution<'a> {
        Execution::of(task)
            .by(self.executor.parse().expect("a registered one"))
            .with_settings(RunSettings {
                plans_in_background: self.plans_in_background,
                prepares_in_background: self.prepares_in_background,
                monitors_slack: self.plans_in_background,
                ..RunSettings::default()
            })
            .persistent(true)
            .with_explanations()
    }

    /// Returns its record, which is rotated at this percentage of the possible times.
    fn recorded(self, percent: u64) -> Vec<Segment> {
        let task = self.task();
        let dice = &mut RandomNumbers(self.seed);
        let script = script(&task, dice);
        let lengths: Vec<Rational> = (0..12).map(|_| Rational::new(dice.small(60), 10)).collect();
        let quarters: Vec<i64> = (0..7).map(|_| dice.small(3) - 1).collect();
        let readying = lengths
            .iter()
            .rev()
            .map(|length| length / &Rational::from(2));
        let readying: Vec<Rational> = readying.collect();
        let planner = ScriptedBackgroundPlanner::with_planning_times(&lengths)
            .with_preparation_times(&readying);
        let (mut world, must_end) = announcing_world((300, script), &planner, &quarters);
        let segments = Arc::new(Mutex::new(vec![Segment::default()]));
        let recorder = Rotating {
            task: Arc::clone(&task),
            segments: Arc::clone(&segments),
            percent,
            dice: dice.clone(),
        };
        let execution = self.execution(&task);
        let execution = if self.plans_in_background {
            execution
                .with_preparer(ScriptedBackgroundPreparer(planner.clone(), irr()))
                .with_planner(planner)
        } else {
            execution.with_planner(SlowPlanner(self.seed))
        };
        execution
            .recorded_by(recorder)
            .with_stop_check(move || must_end.load(Ordering::SeqCst))
            .run_in(&mut world);
        std::mem::take(&mut *segments.lock().expect("not poisoned"))
    }

    /// Replays a segment, or its beginning. Returns the number of equal lines, and the first
    /// difference.
    fn played(self, segment: &Segment, lines: &[String]) -> (usize, Option<String>) {
        let snapshot = segment.snapshot.as_ref();
        let all = [HEADER].into_iter();
        let all = all.chain(snapshot.map(String::as_str));
        let all: Vec<&str> = all.chain(lines.iter().map(String::as_str)).collect();
        let stored = Stored::read(&format!("{}\n", all.join("\n"))).expect("whole");
        let task = self.task();
        let line = stored.snapshot().expect("a snapshot");
        let stand = line.map(|it| it.restored(&task).expect("of this task"));
        assert_eq!(stand.is_some(), snapshot.is_some());
        let mut replay = Replay::new(&stored, Arc::clone(&task));
        let interruption = replay.interruption();
        self.execution(&task)
            .resume_from(stand)
            .with_planner(ReplayPlanner::new(&stored))
            .with_preparer(ReplayPreparer(PlanPreparer::new(irr())))
            .recorded_by(&mut replay)
            .with_stop_check(move || interruption.load(Ordering::SeqCst))
            .run_in(&mut ReplayWorld::new(&stored, &task));
        let (agreed, difference) = replay.outcome();
        let difference = difference.map(|it| format!("{it:#?}"));
        (agreed, difference)
    }
}

/// Returns a line without the parts that depend on the beginning of the record.
fn plain(line: &str) -> Line {
    let mut line: Line = serde_json::from_str(line).expect("a line");
    match &mut line {
        Line::Resting(resting) => {
            resting.dead_end.clear();
            let unreached = resting.unreached.iter_mut().flatten();
            unreached.for_each(|goal| goal.reasons.clear());
        }
        Line::Over(report) => {
            report.executed.clear();
            report.reasons.clear();
        }
        _ => {}
    }
    line
}

fn cases() -> impl Iterator<Item = Case> {
    let executors = [
        "guarded",
        "live",
        "stn",
        "fixed(50)",
        "adaptable",
        "esterel",
    ];
    (0..60).map(move |seed| Case {
        executor: executors[usize::try_from(seed % 6).expect("small")],
        seed,
        plans_in_background: seed % 4 != 0,
        prepares_in_background: seed % 4 > 1,
    })
}

/// Rotations do not change any decision. Each segment alone, even if truncated anywhere, replays
/// with the same decisions and the same texts.
#[test]
fn record_rotated_during_run_replays_to_same_decisions() {
    let (mut taken_up, mut resting, mut under_way, mut with_news, mut turning) = (0, 0, 0, 0, 0);
    let mut begun = 0;
    for case in cases() {
        let whole = case.recorded(0);
        assert_eq!(whole.len(), 1);
        for percent in [100, 30] {
            let segments = case.recorded(percent);
            let lines = segments.iter().flat_map(|it| &it.lines);
            let (mut place, mut same) = (0, whole[0].lines.iter());
            for line in lines {
                let other = same.next().map(|it| plain(it));
                assert_eq!(Some(plain(line)), other, "{case:?}, line {place}");
                place += 1;
            }
            assert_eq!(same.next(), None, "{case:?}");
            let dice = &mut RandomNumbers(case.seed + percent);
            for (number, segment) in segments.iter().enumerate() {
                let count = segment.lines.len();
                let cut = usize::try_from(dice.below(count as u64 + 1)).expect("small");
                let cut = if dice.below(4) == 0 { cut.min(1) } else { cut };
                for lines in [count, cut] {
                    let (agreed, difference) = case.played(segment, &segment.lines[..lines]);
                    assert_eq!(
                        (agreed, difference.as_deref()),
                        (lines, None),
                        "{case:?}, segment {number} of {}: {:?}",
                        segments.len(),
                        segment.snapshot
                    );
                }
                let snapshot = segment.snapshot.as_deref().unwrap_or_default();
                taken_up += usize::from(snapshot.contains("\"plan\":{"));
                resting += usize::from(snapshot.contains("\"since\":"));
                under_way += usize::from(snapshot.contains("\"under_way\":["));
                with_news += usize::from(snapshot.contains("\"news\":["));
                turning += usize::from(snapshot.contains("\"turn\":{"));
                begun += usize::from(snapshot.contains("\"begun\":["));
            }
        }
    }
    let counts = (taken_up, resting, under_way, with_news, turning, begun);
    assert!(
        taken_up > 300
            && resting > 100
            && under_way > 60
            && with_news > 2
            && turning > 5
            && begun > 3,
        "{counts:?}"
    );
}

/// A snapshot that is impossible in this problem is rejected with a message.
#[test]
fn mismatched_snapshot_is_rejected() {
    let case = Case {
        executor: "stn",
        seed: 2,
        plans_in_background: true,
        prepares_in_background: false,
    };
    let segments = case.recorded(100);
    let mut snapshots = segments.iter().filter_map(|it| it.snapshot.as_ref());
    let is_busy = |it: &&String| {
        it.contains("\"plan\":{") && it.contains("\"under_way\":[") && it.contains("succeeded")
    };
    let busy = snapshots.find(is_busy).expect("there is one");
    for (from, to, why) in [
        ("(fetch ", "(carry ", "unknown action `(carry "),
        (
            "\"outcome\":\"succeeded\"",
            "\"outcome\":\"so-so\"",
            "nothing ends `so-so`",
        ),
        ("\"starts\":", "\"starts_once\":", "unknown field"),
    ] {
        assert!(busy.contains(from), "{busy}");
        let stored = Stored::read(&format!("{HEADER}\n{}\n", busy.replace(from, to)));
        let error = match stored.expect("a trace").snapshot() {
            Ok(line) => line.expect("there").restored(&case.task()).expect_err(from),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(why), "{error}");
    }
}

/// The snapshot contains the knowledge behind the current plan.
#[test]
fn snapshot_of_busy_run_contains_its_state() {
    let case = Case {
        executor: "stn",
        seed: 2,
        plans_in_background: true,
        prepares_in_background: false,
    };
    let segments = case.recorded(100);
    let snapshots = segments.iter().filter_map(|it| it.snapshot.as_ref());
    let mut seen = 0;
    for snapshot in snapshots {
        let stored = Stored::read(&format!("{HEADER}\n{snapshot}\n")).expect("whole");
        let line = stored.snapshot().expect("a snapshot").expect("there");
        let stand = line.restored(&case.task()).expect("of this task");
        let RunPhase::Adopting(it) = &stand.phase else {
            continue;
        };
        seen += 1;
        assert_eq!(it.running.len(), it.situation.running.len());
        assert!(it.plan.steps.len() >= it.running.len());
        let open = stand.starts.iter().filter(|it| it.ended.is_none());
        assert!(open.count() >= stand.belief.running().len());
    }
    assert!(seen > 3, "{seen}");
}
