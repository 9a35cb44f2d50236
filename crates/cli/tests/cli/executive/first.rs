//! First problem of an executive that was started without one.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt as _;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::command::root;
use super::{DOMAIN, PROBLEM, python_is_there, with_robot};

fn problem() -> Value {
    let text = fs::read_to_string(root().join(PROBLEM)).expect("a problem");
    json!({ "problem": text })
}

/// Errors in the command line are reported at the start, before a client sends a problem.
#[test]
fn errors_are_reported_before_listening() {
    let place = folder("told-early");
    let existing = place.join("existing").display().to_string();
    fs::write(&existing, "something").expect("written");
    let nowhere = place.join("nowhere/journal").display().to_string();
    let journal = place.join("journal").display().to_string();
    let no_program = place.join("nobody").display().to_string();
    let empty = place.join("empty.pddl").display().to_string();
    fs::write(&empty, "").expect("written");
    let tests: [(&[&str], &str); 7] = [
        (
            &["--world-process", "cat", "--journal", &nowhere],
            "cannot write the journal",
        ),
        (
            &["--world-process", "cat", "--journal", &existing],
            "`elbowroom serve --resume` resumes its run",
        ),
        (
            &["--world-process", &no_program, "--journal", &journal],
            "cannot start the world",
        ),
        (
            &["--world-process", "no-such-world 1"],
            "cannot start the world",
        ),
        (&["--world-process", &existing], "cannot start the world"),
        (&["--executor", "nobody"], "nobody"),
        (&[], "this is not a PDDL domain"),
    ];
    for (line, words) in tests {
        let domain = if line.is_empty() { &empty } else { DOMAIN };
        let mut child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
            .current_dir(root())
            .args(["serve", domain, "--http", "0"])
            .args(line)
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("the command can be started");
        let mut text = String::new();
        let mut said = BufReader::new(child.stderr.take().expect("it is piped"));
        while said.read_line(&mut text).expect("UTF-8") > 0 && !text.contains("listening") {}
        if text.contains("listening") {
            let _ = child.kill();
        }
        let status = child.wait().expect("it ends");
        assert_eq!(status.code(), Some(2), "{line:?}: {text}");
        assert!(text.contains(words), "{line:?}: {text}");
    }
    assert!(!fs::exists(&journal).expect("a folder"), "nothing is begun");
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// An accepted problem survives any crash and need not be sent again.
#[test]
fn accepted_first_problem_survives_kill_9() {
    if !python_is_there() {
        return;
    }
    let place = folder("first-killed");
    let journal = place.join("journal").display().to_string();
    let mut line = with_robot(&place, &journal);
    line.retain(|it| it != PROBLEM);
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    let mut own = Executive::start(&place, &line);
    let (status, taken) = own.put("/v1/problem", &problem());
    own.kill();
    assert_eq!((status, &taken["taken"]), (200, &json!(true)), "{taken}");
    let text = fs::read_to_string(&journal).expect("a journal");
    let header = text.lines().next().expect("a first record");
    assert!(header.contains("(done b3)"), "{header}");
    let mut again = Executive::start(&place, &["--resume", &journal]);
    again.await_state(|state| state["why"] == "reached: problem");
    again.post("/v1/stop", &Value::Null);
    assert_eq!(again.end().status.code(), Some(0));
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// A readable problem that cannot be executed with this command line.
#[test]
fn unsupported_first_problem_is_rejected_and_next_accepted() {
    let vary = ["--vary", "deadline (open nothing)"];
    let line = [&[DOMAIN, "--realtime", "10"], &vary[..]].concat();
    let mut own = Executive::start(&folder("first-refused"), &line);
    let wrong = problem();
    let text = wrong["problem"].as_str().expect("a text");
    let until = "(idle r) (open nothing) (at 5000 (not (open nothing)))";
    let right = json!({ "problem": text.replace("(idle r)", until) });
    let (status, refusal) = own.put("/v1/problem", &wrong);
    assert_eq!(status, 422, "{refusal}");
    let error = refusal["error"].as_str().expect("a sentence");
    assert!(error.contains("no timed initial makes it false"), "{error}");
    let (status, taken) = own.put("/v1/problem", &right);
    assert_eq!((status, &taken["taken"]), (200, &json!(true)), "{taken}");
    own.await_state(|state| state["why"] == "reached: problem");
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
}

/// The program exists but cannot be started. This cannot be detected in advance.
#[test]
fn rejected_first_problem_reports_the_reason() {
    let place = folder("first-not-begun");
    let world = place.join("world");
    fs::write(&world, "#!/nowhere/at/all\n").expect("written");
    fs::set_permissions(&world, fs::Permissions::from_mode(0o755)).expect("allowed");
    let world = world.display().to_string();
    let mut own = Executive::start(&place, &[DOMAIN, "--world-process", &world]);
    let (status, refusal) = own.put("/v1/problem", &problem());
    assert_eq!(status, 503, "{refusal}");
    let error = refusal["error"].as_str().expect("a sentence");
    assert!(error.contains("cannot start the world"), "{error}");
    let output = own.end();
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    fs::remove_dir_all(&place).expect("the folder is there");
}

#[test]
fn executive_without_problem_can_be_stopped() {
    let mut own = Executive::start(&folder("first-stopped"), &[DOMAIN, "--realtime", "10"]);
    assert_eq!(own.post("/v1/stop", &Value::Null).0, 200);
    assert_eq!(own.end().status.code(), Some(0));
}

/// The calendar of the command line applies to the client's problem. Its windows are kept for
/// further problems.
#[test]
fn calendar_is_applied_to_first_problem_and_kept_for_further_ones() {
    let place = folder("first-dated");
    let calendar = place.join("calendar.toml");
    let text = "format = \"elbowroom-calendar\"\nversion = 1\ntime_zone = \"UTC\"\n\
        unit = \"seconds\"\nhorizon = \"7 days\"\n\
        [[window]]\nfact = \"(open b3)\"\nhours = \"0 to 24\"\n";
    fs::write(&calendar, text).expect("written");
    let calendar = calendar.display().to_string();
    let line = [DOMAIN, "--realtime", "10", "--calendar", &calendar];
    let mut own = Executive::start(&place, &line);
    let problem = problem();
    let without = problem["problem"]
        .as_str()
        .expect("a text")
        .replace("(open b3)", "");
    let is_open = |state: &Value| {
        let facts = state["facts"].as_array().expect("facts");
        facts.contains(&json!("(open b3)"))
    };
    for _ in 0..2 {
        let (status, taken) = own.put("/v1/problem", &json!({ "problem": without }));
        assert_eq!((status, &taken["taken"]), (200, &json!(true)), "{taken}");
        own.await_state(|state| state["why"] == "reached: problem" && is_open(state));
    }
    own.post("/v1/stop", &Value::Null);
    let output = own.end();
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("note: time 0 is "), "{said}");
    fs::remove_dir_all(&place).expect("the folder is there");
}
