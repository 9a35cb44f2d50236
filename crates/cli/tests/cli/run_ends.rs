//! Runs in worlds that are processes, ended from outside: no process remains.
#![cfg(target_os = "linux")]
#![allow(
    clippy::disallowed_methods,
    reason = "how long a run takes to end is what is tested"
)]

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::command::{elbowroom, root};
use serde_json::Value;

const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];

/// A robot that logs its messages. Each wait takes 0.2 s. Started actions never end, except the one
/// with the number `$2`, which fails. Cancelled actions stop.
const ROBOT: &str = r#"
log=$1; fails=$2; now=0; news=
number() { n=${line#*\"ticket\":}; n=${n%%[!0-9]*}; }
while read -r line; do
  printf '%s\n' "$line" >> "$log"
  case "$line" in
    *'"start"'*) number
      news="$news{\"type\":\"started\",\"ticket\":$n,\"time\":$now}\n"
      if [ "$n" = "$fails" ]; then
        news="$news{\"type\":\"ended\",\"ticket\":$n,\"outcome\":\"failed\",\"time\":$now}\n"
      fi;;
    *'"cancel"'*) number
      news="$news{\"type\":\"ended\",\"ticket\":$n,\"outcome\":\"cancelled\",\"time\":$now}\n";;
    *'"wait"'*|*'"look"'*)
      if [ -z "$news" ]; then sleep 0.2; now=$((now+1)); fi
      printf "$news{\"type\":\"time\",\"now\":$now}\n"; news=;;
    *'"stop"'*) exit 0;;
  esac
done
"#;

/// A robot that answers once, and then does not respond for a minute.
const STUBBORN: &str = r#"
log=$1
trap '' TERM INT HUP
while read -r line; do
  printf '%s\n' "$line" >> "$log"
  case "$line" in
    *'"wait"'*) if [ -n "$asked" ]; then sleep 60; fi; asked=yes
      echo '{"type":"time","now":0}';;
  esac
done
"#;

/// Files of one test.
struct TestFiles(PathBuf);

impl TestFiles {
    fn new(name: &str) -> Self {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("ends-{name}"));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("a folder");
        Self(folder)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).unwrap_or_default()
    }

    /// Returns the messages sent to the world.
    fn messages_to_world(&self) -> Vec<Value> {
        let text = self.read("log");
        let lines = text.lines().map(serde_json::from_str);
        lines.map(|line| line.expect("JSON")).collect()
    }

    /// Starts a run in that world.
    fn run(&self, world: &str, fails: &str, options: &[&str]) -> Child {
        let script = self.file("world.sh");
        fs::write(&script, world).expect("written");
        let world = format!("sh {script} {} {fails}", self.file("log"));
        let trace = self.file("trace.jsonl");
        let mut run = vec!["run", DELIVERY[0], DELIVERY[1], "--world-process", &world];
        run.extend(["--trace", &trace]);
        run.extend(options);
        Command::new(env!("CARGO_BIN_EXE_elbowroom"))
            .current_dir(root())
            .env("NO_COLOR", "1")
            .args(run)
            .stdout(Stdio::piped())
            // Remaining processes of the world would keep the pipe open.
            .stderr(Stdio::null())
            .spawn()
            .expect("the command can be started")
    }

    fn wait_for_message(&self, message: &str, times: usize) {
        let begun = Instant::now();
        while self.read("log").matches(message).count() < times {
            assert!(
                begun.elapsed() < Duration::from_secs(60),
                "{}",
                self.read("log")
            );
            sleep(Duration::from_millis(20));
        }
    }
}

fn send(child: &Child, signal: u32) {
    let killed = Command::new("kill")
        .args([format!("-{signal}"), child.id().to_string()])
        .status()
        .expect("every Unix has `kill`");
    assert!(killed.success());
}

/// Returns the number of messages of this type.
fn count(told: &[Value], kind: &str) -> usize {
    told.iter()
        .filter(|message| message["type"] == kind)
        .count()
}

fn last_entry(place: &TestFiles) -> Value {
    let trace = place.read("trace.jsonl");
    serde_json::from_str(trace.lines().last().expect("a line")).expect("JSON")
}

#[test]
fn signals_shut_down_a_run() {
    for (name, signal) in [("interrupt", 2), ("terminate", 15), ("hang-up", 1)] {
        let place = TestFiles::new(name);
        let child = place.run(
            ROBOT,
            "",
            &["--executor", "esterel", "--planner-states", "400"],
        );
        // The run has begun and waits for the end of an action.
        place.wait_for_message("\"wait\"", 4);
        send(&child, signal);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{name}: {output:?}");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(
            text.starts_with("interrupted: stopped on request"),
            "{name}: {text}"
        );
        assert!(text.contains("cancelled"), "{name}: {text}");
        assert!(!text.contains("still running"), "{name}: {text}");

        let told = place.messages_to_world();
        assert!(count(&told, "start") > 0, "{name}: {told:?}");
        assert_eq!(
            count(&told, "cancel"),
            count(&told, "start"),
            "{name}: {told:?}"
        );
        assert_eq!(told.last().expect("a message")["type"], "stop", "{name}");

        let over = last_entry(&place);
        assert_eq!(over["event"], "over", "{name}: {over}");
        assert_eq!(over["verdict"], "interrupted", "{name}: {over}");
        let replayed = elbowroom(&["run", "--replay", &place.file("trace.jsonl")]);
        assert!(replayed.status.success(), "{name}: {replayed:?}");
    }
}

#[test]
fn interrupted_run_prints_json_document() {
    let place = TestFiles::new("document");
    let child = place.run(ROBOT, "", &["--executor", "esterel", "--json"]);
    place.wait_for_message("\"wait\"", 4);
    send(&child, 2);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    let document: Value = serde_json::from_slice(&output.stdout).expect("a document");
    assert_eq!(document["verdict"], "interrupted");
}

#[test]
fn unresponsive_world_does_not_delay_shutdown() {
    let place = TestFiles::new("stubborn");
    let child = place.run(STUBBORN, "", &["--executor", "esterel"]);
    place.wait_for_message("\"wait\"", 2);
    let begun = Instant::now();
    send(&child, 2);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    assert!(begun.elapsed() < Duration::from_secs(20), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.starts_with("interrupted"), "{text}");
    assert_eq!(last_entry(&place)["verdict"], "interrupted");
}

/// The world has time to stop, unless the user insists.
#[test]
fn third_ctrl_c_ends_the_run_at_once_and_the_second_does_not() {
    let place = TestFiles::new("thrice");
    let mut child = place.run(STUBBORN, "", &["--executor", "esterel"]);
    place.wait_for_message("\"wait\"", 2);
    for _ in 0..2 {
        send(&child, 2);
        sleep(Duration::from_millis(500));
    }
    assert_eq!(child.try_wait().expect("it can be asked"), None);
    let begun = Instant::now();
    send(&child, 2);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    assert!(begun.elapsed() < Duration::from_secs(3));
    assert!(output.stdout.is_empty(), "{output:?}");
}

/// One action fails while another one runs, and the planner finds no plan or fails.
#[test]
fn planner_failure_cancels_actions_and_stops_the_world() {
    let planners = [
        ("none", 1, "no plan to continue with", "no-plan"),
        (
            "false {domain} {problem}",
            2,
            "the planner failed",
            "planner-failed",
        ),
    ];
    for (number, (planner, code, words, verdict)) in planners.into_iter().enumerate() {
        let place = TestFiles::new(&format!("planner-{number}"));
        let plan = root()
            .join("cases/delivery/plan.plan")
            .display()
            .to_string();
        let options = [
            "--executor",
            "esterel",
            "--plan",
            &plan,
            "--planner",
            planner,
        ];
        let child = place.run(ROBOT, "1", &options);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(code), "{planner}: {output:?}");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.contains(words), "{planner}: {text}");
        assert!(!text.contains("still running"), "{planner}: {text}");
        let told = place.messages_to_world();
        // The failed action has ended by itself.
        assert_eq!(count(&told, "start"), 2, "{planner}: {told:?}");
        assert_eq!(count(&told, "cancel"), 1, "{planner}: {told:?}");
        assert_eq!(told.last().expect("a message")["type"], "stop", "{planner}");
        assert_eq!(last_entry(&place)["verdict"], verdict, "{planner}");
    }
}

/// A run in a simulated world on a wall clock ends at the present time.
#[test]
fn wall_clock_run_ends_on_request() {
    let place = TestFiles::new("clock");
    let trace = place.file("trace.jsonl");
    let child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .args(["run", DELIVERY[0], DELIVERY[1], "--realtime", "1"])
        .args(["--trace", &trace])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the command can be started");
    let begun = Instant::now();
    while !place.read("trace.jsonl").contains("\"command\"") {
        assert!(begun.elapsed() < Duration::from_secs(60));
        sleep(Duration::from_millis(20));
    }
    send(&child, 15);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    let over = last_entry(&place);
    assert_eq!(over["verdict"], "interrupted");
    let time = over["time"]["decimal"].as_f64().expect("a time");
    assert!(time < 30.0, "{over}");
    let replayed = elbowroom(&["run", "--replay", &trace]);
    assert!(replayed.status.success(), "{replayed:?}");
}

#[test]
fn a_full_disk_does_not_hide_the_verdict() {
    let run = ["run", DELIVERY[0], DELIVERY[1], "--trace", "/dev/full"];
    let output = elbowroom(&run);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.starts_with("done: goal reached"), "{text}");
    let warning = String::from_utf8_lossy(&output.stderr);
    assert!(
        warning.contains("warning: the trace /dev/full is incomplete"),
        "{warning}"
    );
}

/// Finished trials are kept, and the results are marked as incomplete.
#[test]
fn interrupted_comparison_keeps_finished_trials() {
    for (name, experiment) in [
        ("mixed", "crates/cli/tests/files/late-drives.toml"),
        ("perturbed", "experiments/olisipo_sf3.toml"),
    ] {
        let place = TestFiles::new(name);
        let mut child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
            .current_dir(root())
            .args([
                "compare",
                experiment,
                "--trials",
                "100000000",
                "--jobs",
                "1",
            ])
            .args(["--output", &place.file("results")])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command can be started");
        let progress = BufReader::new(child.stderr.take().expect("a pipe"));
        let mut progress = progress.lines().map_while(Result::ok);
        assert!(progress.any(|line| line.contains(" trials")), "{name}");
        send(&child, 2);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{name}: {output:?}");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.contains("interrupted"), "{name}: {text}");
        let results: Value =
            serde_json::from_str(&place.read("results/results.json")).expect("results");
        assert_eq!(results["is_interrupted"], true, "{name}");
        assert!(
            place.read("results/table.md").contains("interrupted"),
            "{name}"
        );
        let runs = results["cells"][0][0]["runs"].as_u64();
        let count = results["rows"][0]["success"]["count"].as_u64();
        assert!(
            runs.or(count).is_some_and(|count| count > 0),
            "{name}: {results:#}"
        );
    }
}
