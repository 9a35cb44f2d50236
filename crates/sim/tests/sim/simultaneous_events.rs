//! Events at one time are reported in one answer, and form one group.

use std::sync::Arc;

use elbowroom_execution::{ActionHandle, Command, Ending, Event, Observation, World};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::{SimWorld, WorldModel};

const DOMAIN: &str = "(define (domain d) (:requirements :durative-actions :fluents)
    (:predicates (light) (mended) (seen)) (:functions (x))
    (:durative-action burn :parameters () :duration (= ?duration 8) :condition ()
      :effect (and (at start (light)) (at end (not (light)))))
    (:durative-action mend :parameters () :duration (= ?duration 5)
      :condition (over all (light)) :effect (at end (mended)))
    (:durative-action blink :parameters () :duration (= ?duration 0)
      :condition () :effect (and (at start (increase (x) 1)) (at end (seen))))
    (:durative-action drain :parameters () :duration (= ?duration 5)
      :condition (over all (> (x) 0)) :effect (decrease (x) (* #t 2))))";

struct TestTask {
    task: Task,
    tickets: u64,
}

impl TestTask {
    fn new(x: i64) -> Self {
        let problem =
            format!("(define (problem p) (:domain d) (:init (= (x) {x})) (:goal (mended)))");
        let domain = Source::new("domain", DOMAIN);
        let (problem, _) =
            read_problem(&domain, &Source::new("problem", problem.as_str())).expect("correct");
        Self {
            task: Task::new(problem),
            tickets: 0,
        }
    }

    fn start(&mut self, name: &str, duration: Rational) -> Command {
        let schema = self.task.problem().schema(name).expect("an action");
        let action = self.task.instantiate(schema, &[]).expect("no arguments");
        let ticket = ActionHandle(self.tickets);
        self.tickets += 1;
        Command::Start {
            ticket,
            action: Arc::new(action),
            duration: Some(duration),
        }
    }
}

fn seconds(milliseconds: i64) -> Rational {
    Rational::new(milliseconds, 1000)
}

fn ended(observation: &Observation) -> Option<(u64, &str)> {
    match &observation.event {
        Event::Ended { ticket, ending, .. } => Some((ticket.0, ending.name())),
        _ => None,
    }
}

/// Sends the commands at their times, and lets 100 s pass. Returns the reported ends with their
/// times, by answer.
fn simulate(stage: &TestTask, commands: &[(Rational, Command)]) -> Vec<(Rational, Vec<String>)> {
    let model = WorldModel::without_deviations();
    let mut world = SimWorld::new(Arc::new(stage.task.clone()), &model, 0);
    let mut answers = Vec::new();
    let mut wait = |world: &mut SimWorld<'_>, until: &Rational| {
        loop {
            let passage = world
                .wait(until)
                .expect("a simulated world is always there");
            let ends = passage.observations.iter().filter_map(ended);
            let ends: Vec<String> = ends.map(|(n, how)| format!("{n} {how}")).collect();
            if !ends.is_empty() {
                answers.push((passage.now.clone(), ends));
            }
            if passage.observations.is_empty() && passage.now >= *until {
                break;
            }
        }
    };
    for (time, command) in commands {
        wait(&mut world, time);
        world.command(time, command).expect("it is always there");
    }
    wait(&mut world, &Rational::from(100));
    answers
}

#[test]
fn simultaneous_ends_are_reported_together_without_violation() {
    let mut stage = TestTask::new(1);
    let commands = [
        (seconds(0), stage.start("burn", seconds(8000))),
        (seconds(3000), stage.start("mend", seconds(5000))),
    ];
    let ends = ["0 succeeded".to_owned(), "1 succeeded".to_owned()];
    assert_eq!(
        simulate(&stage, &commands),
        [(seconds(8000), ends.to_vec())]
    );
}

#[test]
fn early_light_end_violates_mending() {
    let mut stage = TestTask::new(1);
    let commands = [
        (seconds(0), stage.start("burn", seconds(8000))),
        (seconds(3001), stage.start("mend", seconds(5000))),
    ];
    let told = simulate(&stage, &commands);
    let failed = (seconds(8000), vec!["1 failed".to_owned()]);
    assert_eq!(told.last(), Some(&failed), "{told:?}");
}

#[test]
fn zero_duration_action_ends_with_its_start() {
    let mut stage = TestTask::new(1);
    let commands = [(seconds(2000), stage.start("blink", Rational::ZERO))];
    let ends = vec!["0 succeeded".to_owned()];
    assert_eq!(simulate(&stage, &commands), [(seconds(2000), ends)]);
}

/// An action with a planned duration below the resolution takes the planned duration.
#[test]
fn resolution_does_not_change_planned_durations() {
    let mut stage = TestTask::new(1);
    let short = Rational::new(1, 3000);
    let commands = [(seconds(0), stage.start("blink", short.clone()))];
    assert_eq!(simulate(&stage, &commands)[0].0, short);
}

#[test]
fn strict_bound_may_be_reached_only_at_end() {
    for (x, end, outcome) in [(10, 5000, "0 succeeded"), (9, 4501, "0 failed")] {
        let mut stage = TestTask::new(x);
        let commands = [(seconds(0), stage.start("drain", seconds(5000)))];
        let told = simulate(&stage, &commands);
        assert_eq!(told, [(seconds(end), vec![outcome.to_owned()])], "{x}");
    }
    assert_eq!(Ending::Succeeded.name(), "succeeded");
}
