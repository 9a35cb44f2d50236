//! The executive in the process of its caller.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use elbowroom::execute::{NamedText, RunSpec};
use elbowroom::execution::{
    ActionHandle, Command as WorldCommand, Ending, Event, GoalTerms, Observation, Request,
    TimeAdvance, World, WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom_executive::interface::documents::{Activity, GoalNow, NewGoal};
use elbowroom_executive::request_queue::{ExternalRequest, RequestStatus};
use elbowroom_executive::{EmbeddedWorld, Executive, ExecutiveSettings, StartedAction};

/// Longer than any request takes.
const LONG: Duration = Duration::from_secs(600);

/// Environment variable with the journal of the run that crashes.
const JOURNAL: &str = "ELBOWROOM_TEST_CRASH_JOURNAL";

fn delivery() -> RunSpec {
    let text = |name: &str| {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/delivery");
        NamedText {
            name: name.to_owned(),
            text: std::fs::read_to_string(file.join(name)).expect("a case"),
        }
    };
    RunSpec::new(text("domain.pddl"), text("problem.pddl"))
}

fn with_process_world(journal: &Path) -> Executive {
    let mut spec = delivery();
    let world = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world.py");
    spec.world_process = Some(format!("python3 {}", world.display()));
    let settings = ExecutiveSettings {
        journal: Some(journal.to_owned()),
        ..ExecutiveSettings::default()
    };
    Executive::new(spec, settings).expect("a correct case")
}

fn pursue(goal: &str) -> ExternalRequest {
    ExternalRequest::Request(Request::Pursue {
        name: "next".to_owned(),
        goal: goal.to_owned(),
        terms: GoalTerms::default(),
    })
}

fn wait_for(executive: &Executive, fact: &str) {
    while !executive.status().facts.iter().any(|it| it == fact) {
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Waits until a goal is achieved. Facts of the past are believed while a journal is replayed, but the goal is open then.
fn wait_for_goal(executive: &Executive, name: &str) {
    let is_achieved = |goal: &GoalNow| goal.name == name && goal.state == "achieved";
    while !executive
        .published()
        .all_goals()
        .goals
        .iter()
        .any(is_achieved)
    {
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn folder(name: &str) -> PathBuf {
    let name = format!("elbowroom-in-process-{}-{name}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir(&folder).expect("a folder can be made");
    folder
}

#[test]
fn goal_is_reached_in_simulated_world() {
    let mut spec = delivery();
    spec.realtime = Some(Rational::from(20));
    let executive = Executive::new(spec, ExecutiveSettings::default()).expect("a correct case");
    let unknown = executive.submit(pursue("(at rover nowhere)"), LONG);
    assert!(unknown.is_err(), "{unknown:?}");
    std::thread::scope(|scope| {
        let run = scope.spawn(|| executive.run());
        wait_for(&executive, "(lies parcel office)");
        let accepted = executive.submit(pursue("(at rover depot)"), LONG);
        assert_eq!(accepted, Ok(RequestStatus::Accepted));
        wait_for(&executive, "(at rover depot)");
        executive.stop();
        let outcome = run.join().expect("no panic").expect("an outcome").outcome;
        assert_eq!(outcome.answer.report.verdict, "interrupted");
        assert_eq!(outcome.answer.invalid, [""; 0]);
    });
    assert_eq!(executive.status().activity, Activity::Over);
    assert!(executive.events().trace().contains("\"event\":\"header\""));
    assert!(executive.run().is_err(), "a run is started once");
    let late = executive.submit(pursue("(at rover shelf)"), LONG);
    assert_eq!(late, Ok(RequestStatus::RunEnded));
}

/// World in this process that executes actions as planned, and fails after a number of starts.
struct Robot {
    now: Rational,
    coming: Vec<Observation>,
    starts: Vec<String>,
    most_starts: usize,
    /// Actions that an earlier process has started.
    recalled: Vec<StartedAction>,
}

impl Robot {
    fn new(most_starts: usize) -> Self {
        Self {
            now: Rational::ZERO,
            coming: Vec::new(),
            starts: Vec::new(),
            most_starts,
            recalled: Vec::new(),
        }
    }

    fn report(&mut self, time: Rational, event: Event) {
        self.coming.push(Observation { time, event });
    }

    fn take(&mut self, now: Rational) -> TimeAdvance {
        let is_due = |it: &mut Observation| it.time <= now;
        let observations = self.coming.extract_if(.., is_due).collect();
        self.now.clone_from(&now);
        TimeAdvance { now, observations }
    }
}

impl World for Robot {
    fn command(&mut self, now: &Rational, command: &WorldCommand) -> Result<(), WorldError> {
        let WorldCommand::Start {
            ticket,
            action,
            duration,
        } = command
        else {
            return Ok(());
        };
        if self.starts.len() == self.most_starts {
            return Err(WorldError::new("it has lost its battery").reachable());
        }
        self.starts.push(action.name.clone());
        let (ticket, measured) = (*ticket, Vec::new());
        self.report(now.clone(), Event::Started { ticket, measured });
        if let Some(duration) = duration {
            self.report(now + duration, succeeded(ticket));
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let next = self.coming.iter().map(|it| &it.time).min();
        let now = next.map_or(until, |next| next.min(until));
        let now = now.clone().max(self.now.clone());
        Ok(self.take(now))
    }

    fn look(&mut self, _: &[FactId], _: &[FluentId]) -> Result<Vec<Observation>, WorldError> {
        Ok(Vec::new())
    }
}

impl EmbeddedWorld for Robot {
    fn recall(
        &mut self,
        now: &Rational,
        running: &[StartedAction],
    ) -> Result<Option<TimeAdvance>, WorldError> {
        self.recalled = running.to_vec();
        for action in running {
            self.report(now.clone(), succeeded(action.ticket));
        }
        Ok(Some(self.take(now.clone())))
    }
}

fn succeeded(ticket: ActionHandle) -> Event {
    let (ending, measured) = (Ending::Succeeded, Vec::new());
    Event::Ended {
        ticket,
        ending,
        measured,
    }
}

/// The first world fails at the start of the third action. The second world has finished that action.
#[test]
fn run_in_failed_world_is_resumed_in_another_one() {
    let folder = folder("embedded");
    let journal = folder.join("run.journal");
    let mut spec = delivery();
    spec.is_world_embedded = true;
    let settings = ExecutiveSettings {
        journal: Some(journal.clone()),
        ..ExecutiveSettings::default()
    };
    let executive = Executive::new(spec, settings.clone()).expect("a correct case");
    let mut first = Robot::new(2);
    let outcome = executive.run_in(&mut first).expect("an outcome").outcome;
    assert_eq!(outcome.answer.report.verdict, "world-failed");
    assert_eq!(first.starts.len(), 2);

    let resumed = Executive::resume(&journal, settings.clone()).expect("a journal");
    let locked = Executive::resume(&journal, settings.clone()).err();
    assert!(
        locked
            .expect("locked")
            .to_string()
            .contains("has not ended")
    );
    let error = resumed.run().expect_err("its world is missing");
    assert!(
        error.to_string().contains("in the executive's process"),
        "{error}"
    );
    drop(resumed);

    let resumed = Executive::resume(&journal, settings).expect("a journal");
    let mut second = Robot::new(usize::MAX);
    std::thread::scope(|scope| {
        let run = scope.spawn(|| resumed.run_in(&mut second));
        wait_for_goal(&resumed, "problem");
        let home = NewGoal {
            name: None,
            goal: "(at rover depot)".to_owned(),
            value: None,
            deadline: None,
            within: None,
            release: None,
            after: None,
            keep: false,
            by: None,
        };
        let (name, status) = resumed.submit_goal(home, LONG).expect("a correct goal");
        assert_eq!((name.as_str(), status), ("goal-1", RequestStatus::Accepted));
        wait_for_goal(&resumed, "goal-1");
        resumed.stop();
        let outcome = run.join().expect("no panic").expect("an outcome");
        assert_eq!(outcome.journal_failure, None);
        assert_eq!(outcome.outcome.answer.invalid, [""; 0]);
    });
    let recalled = second.recalled.iter().map(|it| it.action.as_str());
    let pick = "(pick rover parcel shelf)";
    assert_eq!(recalled.collect::<Vec<_>>(), [pick]);
    assert!(!second.starts.iter().any(|it| it == pick));
    std::fs::remove_dir_all(&folder).expect("the folder is there");
}

/// The process crashes after a goal is accepted. The resumed run reaches it.
#[test]
fn crashed_run_is_resumed() {
    if let Some(journal) = std::env::var_os(JOURNAL) {
        let executive = with_process_world(Path::new(&journal));
        std::thread::scope(|scope| {
            scope.spawn(|| executive.run());
            wait_for(&executive, "(lies parcel office)");
            let accepted = executive.submit(pursue("(at rover depot)"), LONG);
            assert_eq!(accepted, Ok(RequestStatus::Accepted));
            std::process::abort()
        });
    }
    let folder = folder("crashed");
    let journal = folder.join("run.journal");
    let test = std::env::current_exe().expect("this test");
    let status = Command::new(test)
        .args([
            "--exact",
            "in_process::crashed_run_is_resumed",
            "--nocapture",
        ])
        .env(JOURNAL, &journal)
        .status();
    assert!(!status.expect("it starts").success(), "it crashes");
    let executive = Executive::resume(&journal, ExecutiveSettings::default()).expect("a journal");
    std::thread::scope(|scope| {
        let run = scope.spawn(|| executive.run());
        wait_for_goal(&executive, "next");
        assert!(
            executive
                .status()
                .facts
                .contains(&"(lies parcel office)".to_owned())
        );
        executive.stop();
        let outcome = run.join().expect("no panic").expect("an outcome");
        assert_eq!(outcome.journal_failure, None);
        assert_eq!(outcome.outcome.answer.invalid, [""; 0]);
    });
    let finished = Executive::resume(&journal, ExecutiveSettings::default());
    let Err(error) = finished else {
        panic!("the run is finished");
    };
    assert!(error.to_string().contains("is over"), "{error}");
    std::fs::remove_dir_all(&folder).expect("the folder is there");
}
