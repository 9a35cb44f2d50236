//! World of the scenarios: actions take their planned durations, except for injected faults.

use std::sync::{Arc, Mutex};

use elbowroom::execute::Execution;
use elbowroom::execution::run::{Report, RunSettings};
use elbowroom::execution::{
    ActionHandle, Cause, Command, Ending, Entry, Event, Observation, Recorder, TimeAdvance, World,
    WorldError,
};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};

/// Domain with two robots that fetch items. Each errand takes 10 s.
pub(crate) const ERRANDS: &str =
    "(define (domain errands) (:requirements :durative-actions :typing)
    (:types robot item)
    (:predicates (free ?r - robot) (here ?x - item) (have ?x - item))
    (:durative-action fetch :parameters (?r - robot ?x - item) :duration (= ?duration 10)
      :condition (and (at start (free ?r)) (at start (here ?x)))
      :effect (and (at start (not (free ?r))) (at end (free ?r)) (at end (have ?x)))))";

pub(crate) fn errands(goal: &str) -> Arc<Task> {
    let problem = format!(
        "(define (problem day) (:domain errands) (:objects r s - robot book cup - item)
           (:init (free r) (free s) (here book) (here cup)) (:goal {goal}))"
    );
    task(ERRANDS, &problem)
}

pub(crate) fn task(domain: &str, problem: &str) -> Arc<Task> {
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(domain), &source(problem));
    Arc::new(Task::new(read.expect("a correct test").0))
}

/// World whose actions take their planned durations, except for injected faults.
#[derive(Default)]
pub(crate) struct Toy {
    pub(crate) now: Rational,
    pub(crate) coming: Vec<Observation>,
    /// Fault of each start, by its number.
    pub(crate) fault: Option<Faults>,
    /// Events reported when an action has ended.
    pub(crate) seen: Vec<Event>,
    /// Started actions that have not ended.
    pub(crate) open: Vec<ActionHandle>,
    /// Time from a cancel to the end of the action, in seconds.
    pub(crate) slides: i64,
}

/// Function from the number of a start to its fault.
pub(crate) type Faults = fn(u64) -> Fault;

pub(crate) enum Fault {
    None,
    Silent,
    Fails,
    Lasts(i64),
    /// Starts late by this number of milliseconds, and takes this number of seconds.
    StartsLate(i64, i64),
}

impl World for Toy {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let at = |time: Rational, event: Event| Observation { time, event };
        let measured = Vec::new;
        match command {
            Command::Start {
                ticket, duration, ..
            } => {
                let ticket = *ticket;
                self.open.push(ticket);
                let fault = self.fault.map_or(Fault::None, |fault| fault(ticket.0));
                let mut begun = now.clone();
                let (duration, ending) = match fault {
                    Fault::Silent => return Ok(()),
                    Fault::StartsLate(late, seconds) => {
                        begun += Rational::new(late, 1000);
                        (Some(seconds.into()), Ending::Succeeded)
                    }
                    Fault::None => (duration.clone(), Ending::Succeeded),
                    Fault::Lasts(seconds) => (Some(seconds.into()), Ending::Succeeded),
                    Fault::Fails => {
                        let why = "the gripper slips".to_owned();
                        (duration.clone(), Ending::Failed { why })
                    }
                };
                let started = Event::Started {
                    ticket,
                    measured: measured(),
                };
                let end = &begun + duration.unwrap_or_default();
                self.coming.push(at(begun, started));
                let ended = Event::Ended {
                    ticket,
                    ending,
                    measured: measured(),
                };
                self.coming.push(at(end.clone(), ended));
                let seen = self.seen.drain(..).map(|event| at(end.clone(), event));
                self.coming.extend(seen);
            }
            Command::Cancel { ticket } => {
                let about = *ticket;
                self.coming.retain(
                    |it| !matches!(it.event, Event::Ended { ticket, .. } if ticket == about),
                );
                let ended = Event::Ended {
                    ticket: about,
                    ending: Ending::Cancelled,
                    measured: measured(),
                };
                self.coming.push(at(now + &self.slides.into(), ended));
            }
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let next = self.coming.iter().map(|it| it.time.clone()).min();
        let now = next.into_iter().chain([until.clone()]).min();
        self.now = now.unwrap_or_default().max(self.now.clone());
        let now = self.now.clone();
        let observations: Vec<_> = self.coming.extract_if(.., |it| it.time <= now).collect();
        for observation in &observations {
            if let Event::Ended { ticket, .. } = observation.event {
                self.open.retain(|open| *open != ticket);
            }
        }
        Ok(TimeAdvance { now, observations })
    }
}

pub(crate) fn run(task: &Arc<Task>, world: &mut Toy) -> Report {
    let settings = RunSettings {
        monitors_slack: true,
        time_limit: Rational::from(100_000),
        ..RunSettings::default()
    };
    Execution::of(task)
        .with_settings(settings)
        .with_explanations()
        .run_in(world)
}

/// Recorded warnings: actions, each with the latest end for which the plan remains feasible.
#[derive(Clone, Default)]
pub(crate) struct Warnings(pub(crate) Arc<Mutex<Vec<(String, Rational)>>>);

impl Recorder for Warnings {
    fn record(&mut self, entry: &Entry<'_>) {
        if let Entry::Warning { action, until, .. } = entry {
            let mut warnings = self.0.lock().expect("no thread has panicked");
            warnings.push(((*action).to_owned(), (*until).clone()));
        }
    }
}

pub(crate) fn causes(report: &Report) -> Vec<Cause> {
    report.reasons.iter().map(|reason| reason.cause).collect()
}
