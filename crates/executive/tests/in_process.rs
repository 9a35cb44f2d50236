//! The executive in the process of its caller.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use elbowroom::execute::{NamedText, RunSpec};
use elbowroom::execution::{GoalTerms, Request};
use elbowroom::executive::documents::Activity;
use elbowroom::num::Rational;
use elbowroom_executive::request_queue::{ExternalRequest, RequestStatus};
use elbowroom_executive::{Executive, ExecutiveSettings};

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
    spec.realtime = Some(Rational::from(1000));
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
        .args(["--exact", "crashed_run_is_resumed", "--nocapture"])
        .env(JOURNAL, &journal)
        .status();
    assert!(!status.expect("it starts").success(), "it crashes");
    let executive = Executive::resume(&journal, ExecutiveSettings::default()).expect("a journal");
    std::thread::scope(|scope| {
        let run = scope.spawn(|| executive.run());
        wait_for(&executive, "(at rover depot)");
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
