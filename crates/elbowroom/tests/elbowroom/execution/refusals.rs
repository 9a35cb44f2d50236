//! Worlds that repeatedly refuse to start an action.

use std::sync::atomic::Ordering;

use elbowroom::execute::Execution;
use elbowroom::execution::run::{RunSettings, Verdict};
use elbowroom::execution::{
    Command, Ending, Event, Observation, Request, TimeAdvance, World, WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;

use crate::execution::background_planner::{
    AnnouncingWorld, ScriptedBackgroundPlanner, announcing_world,
};
use crate::execution::persistent::scripted::{Notes, fact, pursue, task};

/// World that refuses all starts before a time.
struct Refusing {
    inner: AnnouncingWorld,
    before: Rational,
}

impl World for Refusing {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket, .. } if *now < self.before => {
                let why = "not now".to_owned();
                self.inner.inner.coming.push(Observation {
                    time: now.clone(),
                    event: Event::Ended {
                        ticket: *ticket,
                        ending: Ending::Failed { why },
                        measured: Vec::new(),
                    },
                });
                Ok(())
            }
            _ => self.inner.command(now, command),
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.inner.wait(until)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}

/// Runs in a world that refuses all starts before `tenths` tenths of a second. Returns the start
/// times, the notes and the verdict.
fn run_with_refusals(
    tenths: i64,
    script: Vec<(Rational, Event)>,
    is_lasting: bool,
    plans_in_background: bool,
) -> (Vec<f64>, Vec<String>, Verdict) {
    let task = task("", "(have book)");
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[Rational::ZERO]);
    let (inner, must_end) = announcing_world((300, script), &planner, &[]);
    let mut world = Refusing {
        inner,
        before: Rational::new(tenths, 10),
    };
    let notes = Notes::default();
    let report = Execution::of(&task)
        .by("stn".parse().expect("a registered one"))
        .with_settings(RunSettings {
            plans_in_background,
            ..RunSettings::default()
        })
        .persistent(is_lasting)
        .with_planner(planner)
        .recorded_by(notes.clone())
        .with_stop_check(move || must_end.load(Ordering::SeqCst))
        .run_in(&mut world);
    let notes = notes.0.lock().expect("not poisoned").clone();
    let starts = notes.iter().filter(|it| it.contains(": start"));
    let starts = starts.filter_map(|it| it.split(':').next()?.parse().ok());
    (starts.collect(), notes, report.verdict)
}

/// An action that is refused for twenty seconds does not use up ten new plans, and one that is
/// refused once or twice is retried at once.
#[test]
fn repeated_refusals_increase_the_backoff() {
    for is_lasting in [false, true] {
        let (starts, notes, verdict) = run_with_refusals(200, Vec::new(), is_lasting, true);
        let reached = verdict == Verdict::GoalReached
            || notes.iter().any(|it| it.contains("rest: goal-reached"));
        assert!(reached, "{verdict:?}: {notes:#?}");
        assert!((8..=11).contains(&starts.len()), "{notes:#?}");
        assert!(starts[1] < 0.1 && starts[2] < 0.2, "{starts:?}");
        let waits: Vec<f64> = starts.windows(2).map(|it| it[1] - it[0]).collect();
        let last = waits.len() - 1;
        assert!(
            (waits[last] - 2.0 * waits[last - 1]).abs() < 0.3,
            "{waits:?}"
        );
        // If the run waits for the planner, only planning takes time.
        let (_, _, verdict) = run_with_refusals(200, Vec::new(), false, false);
        assert_eq!(verdict, Verdict::ReplanLimit);
    }
    // The run stops retrying in the end.
    let (starts, notes, _) = run_with_refusals(10_000, Vec::new(), true, true);
    assert!(
        notes.iter().any(|it| it.contains("rest: replan-limit")),
        "{notes:#?}"
    );
    assert!(starts[10] > 50.0, "{starts:?}");
}

/// Any other event may be the cause of the refusal, so it ends the delay.
#[test]
fn backoff_ends_with_any_other_event() {
    let day = task("", "(have book)");
    let seen = vec![
        (Rational::from(7), fact(&day, "(power)", false)),
        (Rational::from(7), fact(&day, "(power)", true)),
    ];
    let asked = vec![(Rational::from(7), pursue("cup", "(have cup)"))];
    let paused = vec![
        (Rational::from(7), Event::Requested(Request::Pause)),
        (Rational::from(8), Event::Requested(Request::Resume)),
    ];
    for (script, is_soon) in [(seen, true), (asked, true), (paused, false)] {
        let (starts, notes, _) = run_with_refusals(65, script, true, true);
        let first = starts.iter().find(|it| **it > 6.5).expect("it goes on");
        // Plans are requested after 6.3 seconds, and then after 12.7.
        assert_eq!(*first < 7.5, is_soon, "{starts:?} {notes:#?}");
    }
}
