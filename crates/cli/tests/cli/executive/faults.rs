//! Abnormal ends: signals, full disks, and paths that are not regular files.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::command::root;
use super::{DOMAIN, PROBLEM, ctl, python_is_there, signal, with_robot};
use crate::skipped::skipped;

/// A resumed executive shuts down in order, like a new one.
#[test]
fn signals_end_a_resumed_executive() {
    if !python_is_there() {
        return;
    }
    for name in ["INT", "TERM", "HUP"] {
        let place = folder(&format!("resumed-{name}"));
        let journal = place.join("journal").display().to_string();
        let line = with_robot(&place, &journal);
        let line: Vec<&str> = line.iter().map(String::as_str).collect();
        let mut own = Executive::start(&place, &line);
        own.await_state(|state| state["activity"] == "executing");
        own.kill();
        let mut again = Executive::start(&place, &["--resume", &journal]);
        again.await_state(|state| state["activity"] != "beginning");
        let process = again.process().to_string();
        signal(&process, name);
        let output = again.end();
        assert_eq!(output.status.code(), Some(0), "{name}: {output:?}");
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(report.contains("stopped on request"), "{name}: {report}");
        let text = fs::read_to_string(&journal).expect("a journal");
        let last = text.lines().last().expect("a record");
        assert!(last.contains("\"interrupted\""), "{name}: {last}");
        fs::remove_dir_all(&place).expect("the folder is there");
    }
}

/// The client whose request fails because of the full disk receives that reason. The report does
/// not claim that a stop was requested.
#[test]
fn full_disk_is_reported_to_client_and_in_report() {
    if !python_is_there() || Command::new("bash").arg("--version").output().is_err() {
        skipped("there is no bash, or no python3");
        return;
    }
    let place = folder("full-disk");
    let journal = place.join("journal").display().to_string();
    // The executive becomes idle at once, so that almost only requests are recorded.
    let text = fs::read_to_string(root().join(PROBLEM)).expect("a problem");
    let problem = place.join("problem.pddl");
    let text = text.replace("(:goal (and (done a3) (done b3)))", "(:goal (and))");
    fs::write(&problem, text).expect("written");
    let problem = problem.display().to_string();
    let mut line = with_robot(&place, &journal);
    line[1].clone_from(&problem);
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    // The first goal fits into the file. The first of the second goal's two records does not, so
    // the goal is never accepted.
    let mut own = Executive::confined(&place, &line, 30);
    own.await_state(|state| state["activity"] == "resting");
    assert_eq!(own.post("/v1/pause", &Value::Null).0, 200);
    // Each goal is recorded twice, and is longer than all other records.
    let goal = format!("(and {})", "(done a1) ".repeat(1000));
    let answers = (0..10).map(|number| {
        let asked = json!({"goal": goal, "name": format!("goal-{number}")});
        own.post("/v1/goals", &asked)
    });
    let refused = answers.filter(|(status, _)| *status != 200).take(1).last();
    let (status, refusal) = refused.expect("the disk is full some time");
    assert_eq!(status, 503, "{refusal}");
    let error = refusal["error"].as_str().expect("a sentence");
    assert!(error.contains("the journal cannot be written"), "{error}");
    let output = own.end();
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let report = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        report.contains("failed: the journal cannot be written")
            && !report.contains("stopped on request"),
        "{report}"
    );
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(errors.contains("`elbowroom serve --resume`"), "{errors}");
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// Opening a named pipe blocks until another process writes to it.
#[test]
fn non_file_journal_is_rejected_without_waiting() {
    let place = folder("no-file");
    let pipe = place.join("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status();
    if !made.is_ok_and(|it| it.success()) {
        skipped("there is no mkfifo");
        return;
    }
    for command in ["run", "serve"] {
        for path in [&pipe, &place] {
            let (code, said) = ended(&[command, "--resume", &path.display().to_string()]);
            assert_eq!(code, Some(2), "{command}: {said}");
            assert!(said.contains("is not a file"), "{command}: {said}");
        }
    }
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// Returns the exit code and standard error of the command, which must end within a minute.
fn ended(line: &[&str]) -> (Option<i32>, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .args(line)
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("the command can be started");
    let mut is_over = || child.try_wait().expect("it can be asked").is_some();
    let in_time = (0..3000).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        is_over()
    });
    if !in_time {
        let _ = child.kill();
    }
    let output = child.wait_with_output().expect("its output");
    assert!(in_time, "{line:?} does not end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), said)
}

/// The client receives the executive's reason if its request for trace lines is refused.
#[test]
fn ctl_events_reports_reason_of_rejection() {
    let refusal =
        json!({"error": "the lines up to 7 are no longer in memory", "help": "ask for later ones"});
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
    let address = listener.local_addr().expect("it has one").to_string();
    let body = refusal.to_string();
    let served = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        let mut request = [0; 4096];
        let _ = stream.read(&mut request);
        let length = body.len();
        let answer = format!("HTTP/1.1 410 Gone\r\nContent-Length: {length}\r\n\r\n{body}");
        stream.write_all(answer.as_bytes()).expect("it reads");
    });
    let done = ctl(&["--to", &address, "events", "--after", "0"]);
    served.join().expect("it was asked");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(2), "{said}");
    for words in [
        "the lines up to 7 are no longer in memory",
        "ask for later ones",
    ] {
        assert!(said.contains(words), "{said}");
    }
    assert!(!said.contains("is not an executive"), "{said}");
}

#[test]
fn existing_journal_is_resumed_by_its_own_command() {
    let place = folder("existing");
    let journal = place.join("journal");
    fs::write(&journal, "something").expect("written");
    let journal = journal.display().to_string();
    for (command, advice) in [
        ("run", "`elbowroom run --resume`"),
        ("serve", "`elbowroom serve --resume`"),
    ] {
        let line = [
            command,
            DOMAIN,
            PROBLEM,
            "--world-process",
            "cat",
            "--journal",
            &journal,
        ];
        let (code, said) = ended(&line);
        assert_eq!(code, Some(2), "{command}: {said}");
        assert!(said.contains(advice), "{command}: {said}");
    }
    assert!(Path::new(&journal).exists());
    fs::remove_dir_all(&place).expect("the folder is there");
}
