//! World models that executives learn from their journals and use as their beliefs.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::{command, python_is_there};

const ROADS: &str = "crates/cli/tests/files/two-roads";

fn roads(file: &str) -> String {
    format!("{ROADS}/{file}")
}

/// Executes a problem file in the world with the two roads, with `options`.
fn run(problem: &str, options: &[&str]) -> Output {
    let (domain, problem) = (roads("domain.pddl"), roads(problem));
    let world = format!("python3 {}", roads("world.py"));
    let begin = ["run", &domain, &problem, "--world-process", &world];
    command::elbowroom(&[&begin[..], options].concat())
}

fn text(output: &[u8]) -> String {
    String::from_utf8_lossy(output).into_owned()
}

/// Uses both roads five times, with a fixed plan, and learns from the journals.
fn learn(folder: &Path, experience: &str) {
    let plan = folder.join("both.plan");
    let steps = "0: (long-road) [5]\n6: (back) [1]\n8: (short-road) [2]\n11: (sign) [1]\n";
    fs::write(&plan, steps).expect("written");
    let plan = plan.display().to_string();
    for day in 0..5 {
        let journal = folder.join(format!("{day}.journal"));
        let journal = journal.display().to_string();
        let learn = [
            "--plan",
            &plan,
            "--journal",
            &journal,
            "--learn",
            experience,
        ];
        let done = run("day.pddl", &learn);
        assert_eq!(done.status.code(), Some(0), "{done:?}");
    }
}

#[test]
fn executors_use_world_learnt_from_journals() {
    if !python_is_there() {
        return;
    }
    let folder = folder("believed");
    let experience = folder.join("experience").display().to_string();
    let believing = ["--executor", "policy", "--believed", &experience, "--json"];
    // Without a model, all actions are expected to go as planned.
    let learning = ["--learn", &experience, "--journal"];
    let unused = folder.join("unused.journal").display().to_string();
    let before = run(
        "closing.pddl",
        &[&believing[..], &learning, &[&unused]].concat(),
    );
    assert!(
        text(&before.stderr).contains("has no model yet"),
        "{before:?}"
    );
    assert_eq!(before.status.code(), Some(1), "{before:?}");
    learn(&folder, &experience);
    let trace = folder.join("after.jsonl").display().to_string();
    let after = run(
        "closing.pddl",
        &[&believing[..], &["--trace", &trace]].concat(),
    );
    assert_eq!(after.status.code(), Some(0), "{after:?}");
    let answer: Value = serde_json::from_slice(&after.stdout).expect("JSON");
    assert!(answer.to_string().contains("(long-road)"), "{answer}");
    let model = folder.join("experience/world.toml").display().to_string();
    let logs = fs::read_dir(folder.join("experience")).expect("a folder");
    let logs = logs.map(|it| it.expect("an entry").path());
    let logs = logs.filter(|it| it.extension().is_some_and(|it| it == "journal"));
    assert_eq!(logs.count(), 6);
    let replay = command::elbowroom(&["run", "--replay", &trace]);
    assert_eq!(replay.status.code(), Some(0), "{replay:?}");
    let page = command::elbowroom(&["report", &trace]);
    assert!(text(&page.stdout).contains("Predictions of the believed world"));
    // The model may contain sections that do not apply to the problem.
    let mut more = fs::read_to_string(&model).expect("a model");
    more.push_str("\n[[duration]]\naction = \"(fly home)\"\nconstant = 3\n");
    fs::write(&model, more).expect("written");
    let other = run("closing.pddl", &believing);
    assert_eq!(other.status.code(), Some(0), "{other:?}");
    assert!(text(&other.stderr).contains("1 section"), "{other:?}");
    // The answer contains predictions and observations.
    let journal = folder.join("4.journal").display().to_string();
    let expected = folder.join("expected.toml").display().to_string();
    let told = command::elbowroom(&["learn", &journal, "-o", &expected]);
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let said = command::elbowroom(&["learn", &journal, "--world", &expected]);
    let said = text(&said.stdout);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("short-road 12 12 1 of 1 0 0 of 1"), "{said}");
}

#[test]
fn executors_with_rollouts_pursue_changing_goals() {
    let folder = folder("believed-goals");
    let world = folder.join("world.toml");
    let slow = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"short-road\"\nconstant = 12\n";
    fs::write(&world, slow).expect("written");
    let world = world.display().to_string();
    // `lookahead` does not use durations of the model.
    for (executor, problem) in [
        ("policy", "closing.pddl"),
        ("live:5", "closing.pddl"),
        ("lookahead", "day.pddl"),
    ] {
        let (domain, problem) = (roads("domain.pddl"), roads(problem));
        let line = [&domain, &problem, "--realtime", "20", "--believed", &world];
        let options = ["--executor", executor, "--world", &world];
        let mut own = Executive::start(&folder, &[&line[..], &options].concat());
        own.await_state(|state| state["activity"] == "resting");
        for (name, goal) in [("signed", "(signed)"), ("home", "(and (home) (signed))")] {
            let (status, taken) = own.post("/v1/goals", &json!({"goal": goal, "name": name}));
            assert_eq!(status, 200, "{taken}");
            let reached = format!("reached: {name}");
            own.await_state(|state| state["why"] == reached.as_str());
        }
        let (_, all) = own.get("/v1/goals");
        let goals = all["goals"].as_array().expect("goals");
        let is_achieved = |goal: &Value| goal["state"] == "achieved";
        assert!(goals.iter().all(is_achieved), "{executor}: {all}");
        own.post("/v1/stop", &Value::Null);
        assert_eq!(own.end().status.code(), Some(0), "{executor}");
    }
}

/// With the durations of the domain, the short road would be planned each time, and miss the deadline.
#[test]
fn every_plan_has_believed_durations_and_commands_have_those_of_the_domain() {
    if !python_is_there() {
        return;
    }
    let folder = folder("believed-plans");
    let world = folder.join("world.toml");
    let slow = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"short-road\"\nconstant = 12\n\
                [[duration]]\naction = \"long-road\"\nrelative = true\nconstant = 1.2\n";
    fs::write(&world, slow).expect("written");
    let (believed, process) = (
        world.display().to_string(),
        format!("python3 {}", roads("world.py")),
    );
    let (domain, problem) = (roads("domain.pddl"), roads("day.pddl"));
    let line = [
        &domain,
        &problem,
        "--world-process",
        &process,
        "--believed",
        &believed,
    ];
    let mut own = Executive::start(&folder, &line);
    own.await_state(|state| state["why"] == "reached: problem");
    let reached = |name: &str| format!("reached: {name}");
    let give = |goal: &str, name: &str| {
        let (status, taken) = own.post("/v1/goals", &json!({"goal": goal, "name": name}));
        assert_eq!(status, 200, "{taken}");
    };
    give("(home)", "back");
    own.await_state(|state| state["why"] == reached("back").as_str());
    give("(delivered)", "parcel");
    own.await_state(|state| state["why"] == reached("parcel").as_str());
    let (_, guarantee) = own.get("/v1/guarantee");
    assert_eq!(guarantee["durations"], "believed", "{guarantee}");
    own.post("/v1/stop", &Value::Null);
    let done = own.end();
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    // The world received the duration of the domain, which took as long as that.
    let trace = folder.join("trace.jsonl");
    let lines = fs::read_to_string(&trace).expect("a trace");
    let lines = lines
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let commands: Vec<Value> = lines
        .filter(|line| line["command"]["action"] == "(long-road)")
        .collect();
    assert_eq!(commands.len(), 2, "{commands:?}");
    for command in commands {
        assert_eq!(command["command"]["duration"]["exact"], "5", "{command}");
        assert_eq!(command["expected"]["exact"], "6", "{command}");
    }
    let trace = trace.display().to_string();
    let replay = command::elbowroom(&["run", "--replay", &trace]);
    assert_eq!(replay.status.code(), Some(0), "{replay:?}");
}

#[test]
fn stopped_executives_learn_from_the_whole_journal() {
    if !python_is_there() {
        return;
    }
    let folder = folder("learning");
    let experience = folder.join("experience").display().to_string();
    // A journal inside the folder is counted once.
    fs::create_dir(&experience).expect("a folder");
    let journal = folder.join("experience/run.journal").display().to_string();
    let world = format!("python3 {}", roads("world.py"));
    let (domain, problem) = (roads("domain.pddl"), roads("day.pddl"));
    let line = [&domain, &problem, "--world-process", &world];
    let learn = ["--journal", &journal, "--learn", &experience];
    let mut own = Executive::start(&folder, &[&line[..], &learn].concat());
    own.await_state(|state| state["why"] == "reached: problem");
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
    let model = fs::read_to_string(folder.join("experience/world.toml")).expect("a model");
    assert!(
        model.contains("# from 1 durations\n[[duration]]\naction = \"short-road\""),
        "{model}"
    );
}

#[test]
fn believed_durations_may_exceed_every_deadline_by_far() {
    if !python_is_there() {
        return;
    }
    let folder = folder("believed-long");
    let world = folder.join("world.toml");
    let endless = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"short-road\"\nconstant = 1e15\n";
    fs::write(&world, endless).expect("written");
    let world = world.display().to_string();
    let done = run(
        "closing.pddl",
        &["--executor", "policy", "--believed", &world],
    );
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    assert!(text(&done.stdout).contains("(long-road)"), "{done:?}");
}
