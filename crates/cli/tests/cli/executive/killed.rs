//! Executives that are killed after a random number of journal records while goals are added and
//! cancelled, also while their journals are rotated.
//!
//! `ELBOWROOM_SERVE_KILLS=100 cargo test --workspace --test cli executive::killed -- --nocapture` runs
//! a hundred of them. The number of an executive is the seed of the requests and of these numbers.

#![allow(
    clippy::print_stdout,
    reason = "how often executives were killed is worth seeing"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::command;
use super::{python_is_there, with_robot};
use crate::robots::{Rng, check_tickets, record_count};

const DONE: [&str; 6] = ["a1", "a2", "a3", "b1", "b2", "b3"];
/// Options that rotate the journal after every few actions and keep all segments.
const SEGMENTS: [&str; 4] = ["--journal-size", "30K", "--journal-segments", "1000"];

/// Requests sent to an executive, and its answers.
#[derive(Default)]
struct SentRequests {
    goals: u64,
    /// Accepted goals, with `true` if they may have been cancelled since.
    taken: BTreeMap<String, bool>,
}

impl SentRequests {
    /// Sends a random request. Returns `None` if the executive is gone.
    fn ask(&mut self, own: &Executive, dice: &mut Rng) -> Option<()> {
        let job = DONE[usize::try_from(dice.below(6)).expect("small")];
        if dice.below(5) == 0 {
            let names: Vec<String> = self.taken.keys().cloned().collect();
            let count = names.len() as u64;
            if count > 0 {
                let name = &names[usize::try_from(dice.below(count)).expect("small")];
                self.taken.insert(name.clone(), true);
                let path = format!("/v1/goals/{name}");
                own.ask_if_there("DELETE", &path, &Value::Null)?;
            }
            return Some(());
        }
        // The errand is undone and has to be repeated.
        let undone = json!({"fact": format!("(done {job})"), "becomes": false});
        own.ask_if_there("POST", "/v1/facts", &undone)?;
        self.goals += 1;
        let name = format!("g{}", self.goals);
        let goal = json!({"name": name, "goal": format!("(done {job})")});
        let (status, answer) = own.ask_if_there("POST", "/v1/goals", &goal)?;
        // A resumed executive listens before it has replayed its journal.
        assert!([200, 202, 409].contains(&status), "{answer}");
        if answer["taken"] == true {
            self.taken.insert(name, false);
        }
        Some(())
    }
}

/// Maximum number of journal records between two kills.
const MAX_RECORDS: u64 = 120;

/// Kills a process, in a thread, when its journal has `count` more records.
fn kill_after_records(process: u32, journal: &str, count: u64) -> JoinHandle<()> {
    let journal = journal.to_owned();
    let records = move || -> u64 { segments(&journal).iter().map(|it| record_count(it)).sum() };
    let last = records() + count;
    std::thread::spawn(move || {
        for _ in 0..12_000 {
            if records() >= last {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        super::kill(&process.to_string());
    })
}

/// The segments of a journal, the first one first.
fn segments(journal: &str) -> Vec<String> {
    let later = (1..).map(|number| format!("{journal}.{number}"));
    let mut all: Vec<String> = later.take_while(|it| Path::new(it).exists()).collect();
    all.reverse();
    all.push(journal.to_owned());
    all
}

/// Returns the names of the goals that were reached according to any segment.
fn reached(journal: &str) -> BTreeSet<String> {
    let mut reached = BTreeSet::new();
    for segment in segments(journal) {
        // A segment may be missing while the segments are renumbered.
        let text = fs::read_to_string(&segment).unwrap_or_default();
        let is_about_goals =
            |line: &&str| line.contains("\"resting\"") || line.contains("\"event\":\"goal\"");
        for line in text.lines().filter(is_about_goals) {
            // The last line may be incomplete.
            let Ok(line) = serde_json::from_str::<Value>(&line[9..]) else {
                continue;
            };
            if line["verdict"] == "goal-reached" {
                let names = line["goals"].as_array().expect("goals").iter();
                reached.extend(names.filter_map(Value::as_str).map(str::to_owned));
            } else if line["becomes"] == "achieved" {
                reached.extend(line["name"].as_str().map(str::to_owned));
            }
        }
    }
    reached
}

/// Number of kills, and of new journal segments: those written when idle (`at_rest`), and those
/// written on the adoption of a plan (`amid`).
#[derive(Clone, Copy, Debug, Default)]
struct Killed {
    kills: u64,
    while_idle: usize,
    while_busy: usize,
    /// Rotations while actions were running.
    with_running_actions: usize,
}

/// Kills an executive several times.
fn killed(number: u64) -> Killed {
    let (place, mut dice) = (folder(&format!("serve-kill-{number}")), Rng(number));
    dice.below(2);
    let journal = place.join("journal").display().to_string();
    let mut beginning = with_robot(&place, &journal);
    beginning.extend(["--max-replans", "100000"].map(str::to_owned));
    let mut asked = SentRequests::default();
    let kills = 3 + dice.below(4);
    for _ in 0..kills {
        let mut own = launched(&place, &journal, &beginning);
        let killer = kill_after_records(own.process(), &journal, dice.below(MAX_RECORDS));
        while asked.ask(&own, &mut dice).is_some() {
            let pause = if dice.below(3) == 0 { 1500 } else { 100 };
            std::thread::sleep(Duration::from_millis(dice.below(pause)));
        }
        killer.join().expect("it kills");
        own.kill();
        if dice.below(3) == 0 {
            super::kill(&fs::read_to_string(place.join("pid")).unwrap_or_default());
        }
    }
    let what = format!("executive {number} after {kills} kills");
    let mut own = launched(&place, &journal, &beginning);
    // Goals are only accepted after the replay of the journal. All open goals can be reached.
    let last = json!({"name": "last", "goal": "(done a1)"});
    while own.post("/v1/goals", &last).0 != 200 {
        std::thread::sleep(Duration::from_millis(100));
    }
    let is_at_rest = |state: &Value| {
        state["activity"] == "resting" && state["goals"].as_array().is_some_and(Vec::is_empty)
    };
    own.await_state(is_at_rest);
    own.post("/v1/stop", &Value::Null);
    let output = own.end();
    assert_eq!(output.status.code(), Some(0), "{what}: {output:?}");
    let numbered = fs::read_dir(&place).expect("the folder").filter(|it| {
        let name = it.as_ref().expect("a file").file_name();
        name.to_string_lossy().starts_with("journal.")
    });
    assert_eq!(
        numbered.count() + 1,
        segments(&journal).len(),
        "{what}: a number is missing among the segments"
    );
    let reached = reached(&journal);
    for (name, _) in asked
        .taken
        .iter()
        .filter(|(_, is_cancelled)| !**is_cancelled)
    {
        assert!(
            reached.contains(name),
            "{what}: {name} was lost: {reached:?}"
        );
    }
    check_tickets(&place, &what);
    let mut told = Killed {
        kills,
        ..Killed::default()
    };
    let segments = segments(&journal);
    for segment in &segments {
        let text = fs::read_to_string(segment).expect("a journal");
        let second = text.lines().nth(1).unwrap_or_default();
        if second.contains("\"event\":\"snapshot\"") {
            let is_amid = second.contains("\"plan\":{");
            told.while_idle += usize::from(!is_amid);
            told.while_busy += usize::from(is_amid);
            told.with_running_actions += usize::from(second.contains("\"under_way\":["));
        }
        let replayed = command::elbowroom(&["run", "--replay", segment]);
        assert_eq!(
            replayed.status.code(),
            Some(0),
            "{what}: {segment}: {replayed:?}"
        );
    }
    assert!(
        !place.join("journal.new").exists(),
        "{what}: half a segment is left"
    );
    fs::remove_dir_all(&place).expect("the folder is there");
    told
}

fn launched(place: &Path, journal: &str, beginning: &[String]) -> Executive {
    // Without a first record, the executive never began.
    let has_begun = fs::read(journal).is_ok_and(|text| text.contains(&b'\n'));
    let line: Vec<&str> = if has_begun {
        vec!["--resume", journal]
    } else {
        let _ = fs::remove_file(journal);
        beginning.iter().map(String::as_str).collect()
    };
    Executive::start(place, &[&line[..], &SEGMENTS].concat())
}

/// No accepted goal is lost, nothing is started twice, and every segment of the journal can be
/// replayed.
#[test]
fn killed_executive_resumes_with_accepted_requests() {
    if !python_is_there() {
        return;
    }
    let count = std::env::var("ELBOWROOM_SERVE_KILLS").ok();
    let count: u64 = count.and_then(|it| it.parse().ok()).unwrap_or(6);
    let workers: Vec<_> = (0..3)
        .map(|worker| {
            let numbers = (worker..count).step_by(3);
            std::thread::spawn(move || numbers.map(killed).collect::<Vec<_>>())
        })
        .collect();
    let mut all = Vec::new();
    for worker in workers {
        all.extend(worker.join().expect("each executive was right"));
    }
    let kills: u64 = all.iter().map(|it| it.kills).sum();
    let sum = |of: fn(&Killed) -> usize| all.iter().map(of).sum::<usize>();
    let (at_rest, amid) = (sum(|it| it.while_idle), sum(|it| it.while_busy));
    let under_way = sum(|it| it.with_running_actions);
    println!(
        "{count} executives, killed {kills} times; their journals were begun anew {at_rest} times at rest, and \
         {amid} times with a plan; {under_way} times, something was under way"
    );
    assert!(amid > 0, "no journal was begun anew amid a run");
}

/// The run can be resumed wherever the program is killed during a rotation: from the old segment
/// until the new one is renamed.
#[test]
fn journal_killed_during_rotation_is_resumed() {
    if !python_is_there() {
        return;
    }
    let place = folder("about-to-begin-anew");
    let journal = place.join("journal").display().to_string();
    let (new, earlier) = (place.join("journal.new"), place.join("journal.1"));
    let line = with_robot(&place, &journal);
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    let mut own = Executive::start(&place, &line);
    own.await_state(|state| state["why"] == "reached: problem");
    own.kill();
    let line = ["--resume", &journal, "--journal-size", "1K"];
    let line = [&line[..], &SEGMENTS[2..]].concat();
    for step in 0..5 {
        let text = fs::read(&journal).expect("a journal");
        let written = [0, text.len() / 2, text.len(), text.len(), text.len()][step];
        fs::write(&new, &text[..written]).expect("written");
        if step == 3 {
            // The old segment already has its second name.
            let _ = fs::remove_file(&earlier);
            fs::hard_link(&journal, &earlier).expect("a second name");
        }
        if step == 4 {
            // The earlier segments are already renumbered, and the old segment has no number.
            let all = segments(&journal).len() - 1;
            for number in (1..=all).rev() {
                let to = format!("{journal}.{}", number + 1);
                fs::rename(format!("{journal}.{number}"), to).expect("renamed");
            }
        }
        let mut own = Executive::start(&place, &line);
        let undone = json!({"fact": "(done a3)", "becomes": false});
        let name = format!("step-{step}");
        let goal = json!({"name": name, "goal": "(done a3)"});
        while own.post("/v1/facts", &undone).0 != 200 || own.post("/v1/goals", &goal).0 != 200 {
            std::thread::sleep(Duration::from_millis(100));
        }
        let begins_with_snapshot = || {
            let text = fs::read_to_string(&journal).expect("a journal");
            let second = text.lines().nth(1).map(str::to_owned);
            second.is_some_and(|it| it.contains("\"snapshot\""))
        };
        // An accepted goal appears among the goals with a delay.
        own.await_state(|_| begins_with_snapshot() && reached(&journal).contains(&name));
        own.kill();
        for segment in segments(&journal) {
            let replayed = command::elbowroom(&["run", "--replay", &segment]);
            assert_eq!(replayed.status.code(), Some(0), "step {step}: {replayed:?}");
        }
    }
    let mut own = Executive::start(&place, &line);
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
    assert!(!new.exists(), "half a segment is left");
    // Earlier goals may have been recorded in the segment that was removed above.
    let reached = reached(&journal);
    for name in ["step-3", "step-4"] {
        assert!(reached.contains(name), "{name} was lost: {reached:?}");
    }
    check_tickets(&place, "rotation");
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// Returns the records of a journal that contain a time of the world.
fn passed(journal: &str) -> Vec<Value> {
    let text = fs::read_to_string(journal).expect("a journal");
    let lines = text.lines().filter_map(|line| line.split_once(' '));
    let lines = lines.filter_map(|(_, line)| serde_json::from_str(line).ok());
    lines
        .filter(|line: &Value| line["event"] == "passed")
        .collect()
}

/// Time also passes while no executive runs, for a world on the real clock that does not remember
/// it.
#[test]
fn time_passes_between_kill_and_resume() {
    if !python_is_there() {
        return;
    }
    let pause = Duration::from_secs(3);
    let place = folder("time-between");
    let journal = place.join("journal").display().to_string();
    let robot = "python3 crates/cli/tests/files/forgetful.py";
    let line = ["--world-process", robot, "--journal", &journal];
    let line = [&[super::DOMAIN, super::PROBLEM], &line[..]].concat();
    let mut own = Executive::start(&place, &line);
    own.await_state(|state| state["activity"] == "executing");
    own.kill();
    std::thread::sleep(pause);
    let mut again = Executive::start(&place, &["--resume", &journal]);
    again.await_state(|state| super::exact(&state["now"]) >= pause.as_secs_f64());
    again.post("/v1/stop", &Value::Null);
    assert_eq!(again.end().status.code(), Some(0));
    let lines = passed(&journal);
    let times = lines.iter().map(|line| super::exact(&line["now"]));
    let times: Vec<f64> = times.collect();
    let is_gap = |pair: &[f64]| pair[1] - pair[0] >= pause.as_secs_f64();
    assert!(times.windows(2).any(is_gap), "{times:?}");
    let replayed = command::elbowroom(&["run", "--replay", &journal]);
    assert_eq!(replayed.status.code(), Some(0), "{replayed:?}");
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// The journal of an executive that was always idle contains no report of its world.
#[test]
fn time_passes_while_an_executive_is_idle_from_its_beginning() {
    if !python_is_there() {
        return;
    }
    let place = folder("idle-time");
    let journal = place.join("journal").display().to_string();
    let problem = place.join("problem.pddl").display().to_string();
    let text = fs::read_to_string(super::command::root().join(super::PROBLEM)).expect("a problem");
    let (before, _) = text.split_once("(:goal").expect("a goal");
    fs::write(&problem, format!("{before}(:goal (and)))")).expect("written");
    let robot = "python3 crates/cli/tests/files/forgetful.py";
    let line = ["--world-process", robot, "--journal", &journal];
    let line = [&[super::DOMAIN, &problem], &line[..]].concat();
    let mut own = Executive::start(&place, &line);
    own.await_state(|state| state["activity"] == "resting");
    let pause = Duration::from_secs(2);
    std::thread::sleep(pause);
    own.kill();
    assert_eq!(passed(&journal), Vec::<Value>::new());
    std::thread::sleep(pause);
    let mut again = Executive::start(&place, &["--resume", &journal]);
    // The world is started after the replay of the journal.
    let state = again.await_state(|state| super::exact(&state["now"]) > 0.0);
    assert!(
        super::exact(&state["now"]) >= 2.0 * pause.as_secs_f64(),
        "{state}"
    );
    again.post("/v1/stop", &Value::Null);
    assert_eq!(again.end().status.code(), Some(0));
    fs::remove_dir_all(&place).expect("the folder is there");
}
