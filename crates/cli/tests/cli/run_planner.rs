//! Runs and comparisons with third-party planners.
#![cfg(unix)]

use std::fs;
use std::path::PathBuf;

use crate::command::{elbowroom, root};
use crate::skipped::skipped;

const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A file that no other test uses.
fn temporary(name: &str, content: &str) -> PathBuf {
    let name = format!("elbowroom-{}-planner-{name}", std::process::id());
    let path = std::env::temp_dir().join(name);
    fs::write(&path, content).expect("written");
    path
}

/// Writes a planner that always returns the same plan. Returns its file and its command line.
fn one_plan(name: &str) -> (PathBuf, String) {
    let plan = fs::read_to_string(root().join("cases/delivery/plan.plan")).expect("a plan");
    let script = temporary(name, &format!("cat <<'END'\n{plan}\nEND\n"));
    let line = format!("sh '{}' {{domain}} {{problem}}", script.display());
    (script, line)
}

#[test]
fn another_program_makes_the_first_plan() {
    let (script, line) = one_plan("first.sh");
    let output = elbowroom(&["run", DELIVERY[0], DELIVERY[1], "--planner", &line]);
    assert!(output.status.success(), "{output:?}");
    let said = text(&output.stdout);
    assert!(said.contains("goal reached at 30.003"), "{said}");
    fs::remove_file(script).expect("it is there");
}

/// A new plan is needed in mid-execution, but the planner returns one for the initial state. The
/// validator rejects it, and nothing of it is executed.
#[test]
fn plan_that_does_not_match_the_situation_is_rejected() {
    let (script, line) = one_plan("refused.sh");
    let world = temporary(
        "failing.toml",
        "format = \"elbowroom-world\"\nversion = 1\n\
         [[failure]]\naction = \"pick\"\nprobability = 1\n",
    );
    let world_name = world.display().to_string();
    let arguments = ["--planner", &line, "--world", &world_name, "--json"];
    let output = elbowroom(&[&["run", DELIVERY[0], DELIVERY[1]], &arguments[..]].concat());
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let said = text(&output.stdout);
    assert!(said.contains("planner-failed"), "{said}");
    for file in [script, world] {
        fs::remove_file(file).expect("it is there");
    }
}

#[test]
fn planner_errors_are_reported() {
    let run = |rest: &[&str]| {
        let output = elbowroom(&[&["run", DELIVERY[0], DELIVERY[1]], rest].concat());
        assert!(!output.status.success(), "{output:?}");
        text(&output.stdout) + &text(&output.stderr)
    };
    let said = run(&["--planner", "poopf"]);
    assert!(said.contains("popf, optic, tfd, lpg-td"), "{said}");
    let said = run(&["--planner", "./no-such-planner {domain} {problem}"]);
    assert!(said.contains("no-such-planner"), "{said}");
    let said = run(&["--executor", "live:5"]);
    assert!(said.contains("--world"), "{said}");
}

#[test]
fn an_experiment_can_have_another_planner() {
    let (script, line) = one_plan("experiment.sh");
    let folder = root().join("crates/cli/tests/files");
    let experiment = fs::read_to_string(folder.join("late-drives.toml")).expect("an experiment");
    let absolute = experiment
        .replace("../../../..", &root().display().to_string())
        .replace(
            "late-drives-world.toml",
            &folder.join("late-drives-world.toml").display().to_string(),
        )
        .replace("planner_states = 500", &format!("planner = \"{line}\""));
    let file = temporary("other-planner.toml", &absolute);
    let output = elbowroom(&["compare", &file.display().to_string()]);
    assert!(output.status.success(), "{output:?}");
    assert!(text(&output.stdout).contains("guarded"), "{output:?}");
    for file in [script, file] {
        fs::remove_file(file).expect("it is there");
    }
}

/// `ELBOWROOM_LPG` is the path of LPG-td.
#[test]
fn lpg_makes_a_new_plan_in_the_middle() {
    if std::env::var_os("ELBOWROOM_LPG").is_none() {
        skipped("ELBOWROOM_LPG is not set");
        return;
    }
    // LPG-td does not read empty conditions.
    let domain = fs::read_to_string(root().join(DELIVERY[0])).expect("a domain");
    let domain = temporary("lpg.pddl", &domain.replace(":condition ()", ""));
    let world = temporary(
        "sometimes.toml",
        "format = \"elbowroom-world\"\nversion = 1\n\
         [[failure]]\naction = \"pick\"\nprobability = 0.9\n",
    );
    let (domain_name, world_name) = (domain.display().to_string(), world.display().to_string());
    let mut replans = 0;
    for seed in ["1", "2", "3"] {
        let run = ["run", &domain_name, DELIVERY[1], "--planner", "lpg-td"];
        let how = [
            "--world",
            &world_name,
            "--seed",
            seed,
            "--planning-time",
            "1",
            "--json",
        ];
        let output = elbowroom(&[&run[..], &how[..]].concat());
        let report: serde_json::Value =
            serde_json::from_slice(&output.stdout).expect("a report in JSON");
        replans += report["replans"].as_u64().expect("a number");
    }
    assert!(replans > 0);
    for file in [domain, world] {
        fs::remove_file(file).expect("it is there");
    }
}
