//! World that follows a script, and notes on a run in it.

use elbowroom::execute::{Embedded, Execution};
use elbowroom::execution::run::{Report, RunSettings, Verdict};
use elbowroom::execution::{
    Command, Ending, Entry, Event, GoalChange, GoalTerms, Observation, Planner, PlannerAnswer,
    Recorder, Request, TimeAdvance, World, WorldError,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Robots that fetch items in ten seconds, if there is power.
pub(super) const DOMAIN: &str =
    "(define (domain errands) (:requirements :durative-actions :typing :fluents)
    (:types robot item)
    (:predicates (free ?r - robot) (here ?x - item) (have ?x - item) (power))
    (:functions (charge))
    (:durative-action fetch :parameters (?r - robot ?x - item) :duration (= ?duration 10)
      :condition (and (at start (free ?r)) (at start (here ?x)) (at start (>= (charge) 1))
        (over all (power)))
      :effect (and (at start (not (free ?r))) (at end (free ?r)) (at end (have ?x)))))";

pub(super) const OBJECTS: &str = "(:objects r s - robot book cup key - item)";

pub(crate) fn task(init: &str, goal: &str) -> Arc<Task> {
    let problem = format!(
        "(define (problem day) (:domain errands) {OBJECTS}
           (:init (free r) (here book) (here cup) (here key) (power) (= (charge) 9) {init})
           (:goal {goal}))"
    );
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(DOMAIN), &source(&problem));
    Arc::new(Task::new(read.expect("a correct test").0))
}

/// World without deviations of durations, with other observations and requests by a script. At its
/// end, the run is asked to end.
pub(crate) struct ScriptedWorld {
    pub(crate) now: Rational,
    pub(crate) coming: Vec<Observation>,
    pub(crate) end: Rational,
    pub(crate) stop_requested: Arc<AtomicBool>,
    /// Action with this duration, independent of the planned one.
    pub(crate) slow: Option<(&'static str, Rational)>,
    /// Event that is reported after a cancellation.
    pub(crate) on_cancel: Option<Event>,
}

impl World for ScriptedWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let coming = &mut self.coming;
        let mut tell = |time: Rational, event: Event| coming.push(Observation { time, event });
        let measured = Vec::new;
        match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => {
                let ticket = *ticket;
                let started = Event::Started {
                    ticket,
                    measured: measured(),
                };
                tell(now.clone(), started);
                if let Some(duration) = duration {
                    let slow = self.slow.as_ref().filter(|(name, _)| *name == action.name);
                    let duration = slow.map_or(duration, |(_, duration)| duration);
                    let ended = Event::Ended {
                        ticket,
                        ending: Ending::Succeeded,
                        measured: measured(),
                    };
                    tell(now + duration, ended);
                }
            }
            Command::Cancel { ticket } => {
                let about = *ticket;
                coming.retain(
                    |it| !matches!(it.event, Event::Ended { ticket, .. } if ticket == about),
                );
                let ended = Event::Ended {
                    ticket: about,
                    ending: Ending::Cancelled,
                    measured: measured(),
                };
                let time = now.clone();
                let seen = self.on_cancel.clone().into_iter().chain([ended]);
                coming.extend(seen.map(|event| Observation {
                    time: time.clone(),
                    event,
                }));
            }
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let until = until.min(&self.end).clone();
        let next = self.coming.iter().map(|it| it.time.clone()).min();
        let now = next.into_iter().chain([until]).min().unwrap_or_default();
        self.now = now.max(self.now.clone());
        if self.now >= self.end {
            self.stop_requested.store(true, Ordering::SeqCst);
        }
        let now = self.now.clone();
        let due = self.coming.extract_if(.., |it| it.time <= now).collect();
        Ok(TimeAdvance {
            now: self.now.clone(),
            observations: due,
        })
    }
}

/// Notes on the relevant entries.
#[derive(Clone, Default)]
pub(crate) struct Notes(pub(crate) Arc<Mutex<Vec<String>>>);

impl Notes {
    fn note(&self, note: String) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(note);
    }
}

impl Recorder for Notes {
    fn record(&mut self, entry: &Entry<'_>) {
        let at = |time: &Rational| time.to_decimal(1);
        match entry {
            Entry::Command {
                now,
                command: Command::Start { action, .. },
                ..
            } => {
                self.note(format!("{}: start {}", at(now), action.name));
            }
            Entry::Command {
                now,
                command: Command::Cancel { .. },
                ..
            } => {
                self.note(format!("{}: cancel", at(now)));
            }
            Entry::Planning { now, reason, .. } => {
                self.note(format!("{}: plan, because {}", at(now), reason));
            }
            Entry::Kept { now, .. } => self.note(format!("{}: the plan is kept", at(now))),
            Entry::Goal { now, name, change } => {
                let change = match change {
                    GoalChange::Achieved => "achieved".to_owned(),
                    GoalChange::SetAside { why } => format!("set aside, because {why}"),
                    GoalChange::Pursued => "pursued again".to_owned(),
                    GoalChange::Released => "released".to_owned(),
                    GoalChange::Kept => "kept".to_owned(),
                    GoalChange::Queued { why } => format!("queued, because {why}"),
                    GoalChange::Failed { why } => format!("failed, because {why}"),
                };
                self.note(format!("{}: `{name}` {change}", at(now)));
            }
            Entry::Resting {
                now,
                verdict,
                goals,
                dead_end,
                unreached,
            } => {
                let verdict = verdict.map_or("no goals", Verdict::name);
                let goals = [goals.join(" ")].into_iter();
                let words: Vec<String> = goals
                    .chain(dead_end.iter().map(ToString::to_string))
                    .collect();
                self.note(format!("{}: rest: {verdict} {}", at(now), words.join(": ")));
                // Of one goal, the reasons are those of the dead end.
                for goal in unreached.iter().filter(|_| unreached.len() > 1) {
                    let state = if goal.is_impossible {
                        "impossible"
                    } else {
                        "unplanned"
                    };
                    let words: Vec<String> = goal.reasons.iter().map(ToString::to_string).collect();
                    self.note(format!("`{}` {state}: {}", goal.name, words.join("; ")));
                }
            }
            Entry::Warning {
                now, action, until, ..
            } => {
                self.note(format!("{}: {action} must end by {}", at(now), at(until)));
            }
            Entry::Taken {
                remark: Some(remark),
                now,
                ..
            } => {
                self.note(format!("{}: {remark}", at(now)));
            }
            _ => {}
        }
    }
}

/// Embedded planner that counts its calls.
pub(super) struct Counting(Arc<Mutex<usize>>);

impl Planner for Counting {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        let answer = Embedded::default().plan(task, situation);
        PlannerAnswer {
            seconds: None,
            ..answer
        }
    }
}

pub(super) struct RunResult {
    pub(super) notes: Vec<String>,
    pub(super) plans: usize,
    pub(super) report: Report,
}

/// Makes a persistent run with that script until `end`.
pub(super) fn run(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(impl Into<Rational>, Event)>,
) -> RunResult {
    scripted(task, end, script, |execution| execution.persistent(true))
}

/// Runs with that script until `end`. The run can be paused, and its goal abandoned.
pub(super) fn run_interactive(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(impl Into<Rational>, Event)>,
) -> RunResult {
    scripted(task, end, script, |execution| execution.interactive(true))
}

/// Makes a persistent run in which one action takes so long. Late actions are monitored.
pub(super) fn run_with_slow_action(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(impl Into<Rational>, Event)>,
    slow: (&'static str, Rational),
) -> RunResult {
    scripted_with(task, end, script, Some(slow), |execution| {
        let settings = RunSettings {
            monitors_slack: true,
            ..RunSettings::default()
        };
        execution.with_settings(settings).persistent(true)
    })
}

pub(super) fn scripted(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(impl Into<Rational>, Event)>,
    kind: impl FnOnce(Execution<'_>) -> Execution<'_>,
) -> RunResult {
    scripted_with(task, end, script, None, kind)
}

fn scripted_with(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(impl Into<Rational>, Event)>,
    slow: Option<(&'static str, Rational)>,
    kind: impl FnOnce(Execution<'_>) -> Execution<'_>,
) -> RunResult {
    let must_end = Arc::new(AtomicBool::new(false));
    let script = script.into_iter().map(|(time, event)| Observation {
        time: time.into(),
        event,
    });
    let mut world = ScriptedWorld {
        now: Rational::ZERO,
        coming: script.collect(),
        end: Rational::from(end),
        stop_requested: Arc::clone(&must_end),
        slow,
        on_cancel: None,
    };
    let (notes, plans) = (Notes::default(), Arc::new(Mutex::new(0)));
    let execution = Execution::of(task)
        .with_settings(RunSettings::default())
        .with_planner(Counting(Arc::clone(&plans)))
        .recorded_by(notes.clone())
        .with_stop_check(move || must_end.load(Ordering::SeqCst))
        .with_explanations();
    let report = kind(execution).run_in(&mut world);
    let notes = notes
        .0
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    let plans = *plans.lock().unwrap_or_else(PoisonError::into_inner);
    RunResult {
        notes,
        plans,
        report,
    }
}

pub(crate) fn pursue(name: &str, goal: &str) -> Event {
    pursue_with_value(name, goal, 1)
}

pub(crate) fn pursue_with_value(name: &str, goal: &str, value: i64) -> Event {
    given(name, goal, value, None)
}

pub(crate) fn pursue_by(name: &str, goal: &str, deadline: i64) -> Event {
    given(name, goal, 1, Some(deadline))
}

/// A goal that is released at a time, with a deadline if one is given.
pub(crate) fn pursue_from(name: &str, goal: &str, release: i64, deadline: Option<i64>) -> Event {
    pursue_on(
        name,
        goal,
        GoalTerms {
            deadline: deadline.map(Rational::from),
            release: Some(Rational::from(release)),
            ..GoalTerms::default()
        },
    )
}

/// A goal to keep.
pub(crate) fn keep(name: &str, goal: &str) -> Event {
    pursue_on(
        name,
        goal,
        GoalTerms {
            keep: true,
            ..GoalTerms::default()
        },
    )
}

fn given(name: &str, goal: &str, value: i64, deadline: Option<i64>) -> Event {
    pursue_on(
        name,
        goal,
        GoalTerms {
            value: Rational::from(value),
            deadline: deadline.map(Rational::from),
            ..GoalTerms::default()
        },
    )
}

pub(crate) fn pursue_on(name: &str, goal: &str, terms: GoalTerms) -> Event {
    Event::Requested(Request::Pursue {
        name: name.to_owned(),
        goal: goal.to_owned(),
        terms,
    })
}

pub(crate) fn abandon(name: &str) -> Event {
    let name = name.to_owned();
    Event::Requested(Request::Abandon { name })
}

pub(crate) fn fact(task: &Task, name: &str, truth: bool) -> Event {
    let fact = task.fact_named(name).expect("a correct test");
    Event::Fact { fact, truth }
}

pub(super) fn has(told: &RunResult, note: &str) -> bool {
    told.notes.iter().any(|it| it.contains(note))
}

#[track_caller]
pub(super) fn assert_has(told: &RunResult, notes: &[&str]) {
    let mut left = told.notes.iter();
    for note in notes {
        let found = left.any(|it| it.contains(note));
        assert!(found, "no `{note}` in its place in {:#?}", told.notes);
    }
}

/// Pseudorandom numbers.
#[derive(Clone)]
pub(crate) struct RandomNumbers(pub(crate) u64);

impl RandomNumbers {
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        let factor = 6_364_136_223_846_793_005;
        self.0 = self.0.wrapping_mul(factor).wrapping_add(1_442_695);
        (self.0 >> 33) % limit
    }

    pub(crate) fn small(&mut self, limit: u64) -> i64 {
        i64::try_from(self.below(limit)).expect("small")
    }
}

/// Embedded planner with planning times by the world's clock.
pub(super) struct SlowPlanner(pub(super) u64);

impl Planner for SlowPlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.0 += 1;
        let tenths = i64::try_from(self.0 % 7).expect("a small number");
        PlannerAnswer {
            seconds: Some(Rational::new(tenths, 10)),
            ..Embedded::default().plan(task, situation)
        }
    }
}
