//! The module for browsers gives the same answers as the command, byte for byte.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use elbowroom_web::{Reply, reply};
use serde_json::{Value, json};

const COMMAND: &str = env!("CARGO_BIN_EXE_elbowroom");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Reads a file by the name given to the command.
fn file(name: &str) -> Value {
    let text = std::fs::read_to_string(root().join(name)).expect("a file of the project");
    json!({ "name": name, "text": text })
}

/// Returns the cases with their files.
fn cases() -> Vec<(String, Vec<&'static str>)> {
    let mut cases: Vec<(String, Vec<&'static str>)> = std::fs::read_dir(root().join("cases"))
        .expect("the folder of cases")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .map(|name| {
            let folder = format!("cases/{name}");
            let there = ["plan.plan", "plan.stn", "late.plan"];
            let is_there = |plan: &&str| root().join(&folder).join(plan).is_file();
            let there: Vec<&str> = there.into_iter().filter(is_there).collect();
            (folder, there)
        })
        .collect();
    cases.sort();
    assert!(cases.len() >= 8);
    cases
}

/// Returns the output and exit code of the command with `--json`.
fn command_output(arguments: &[&str]) -> (String, i32) {
    let output = Command::new(COMMAND)
        .args(arguments)
        .arg("--json")
        .current_dir(root())
        .output()
        .expect("the command runs");
    let text = String::from_utf8(output.stdout).expect("the command prints UTF-8");
    (
        text,
        output.status.code().expect("no signal ends the command"),
    )
}

fn reply_to(question: &Value) -> Reply {
    reply(&question.to_string(), &mut || Duration::ZERO)
}

/// Removes the parts of a document that depend on the clock.
fn timeless(document: &str) -> String {
    let lines = document.lines().map(|line| {
        // The command's advice refers to its own options.
        let own = ["\"seconds\":", "\"first_plan_seconds\":", "\"advice\":"];
        let is_own = own.iter().any(|key| line.trim_start().starts_with(key));
        let key = line.split(':').next().unwrap_or_default();
        if is_own {
            format!("{key}: 0\n")
        } else {
            format!("{line}\n")
        }
    });
    lines.collect()
}

fn assert_same(arguments: &[&str], question: &Value) -> Reply {
    let (printed, exit) = command_output(arguments);
    let reply = reply_to(question);
    assert_eq!(
        timeless(&reply.document),
        timeless(&printed),
        "{arguments:?}"
    );
    assert_eq!(i32::from(reply.exit), exit, "{arguments:?}");
    reply
}

#[test]
fn web_answers_match_the_command() {
    for (folder, plans) in cases() {
        let (domain, problem) = (
            format!("{folder}/domain.pddl"),
            format!("{folder}/problem.pddl"),
        );
        let question =
            |ask: &str| json!({ "ask": ask, "domain": file(&domain), "problem": file(&problem) });
        assert_same(&["check", &domain, &problem], &question("check"));
        assert_same(&["plan", &domain, &problem], &question("plan"));
        for plan in plans {
            let plan = format!("{folder}/{plan}");
            let with_plan = |ask: &str| {
                let mut question = question(ask);
                question["plan"] = file(&plan);
                question
            };
            let is_stn = plan.to_ascii_lowercase().ends_with(".stn");
            for ask in ["check", "stn", "envelope", "run"] {
                if is_stn && (ask == "check" || ask == "run") {
                    continue;
                }
                assert_same(&[ask, &domain, &problem, &plan], &with_plan(ask));
            }
            let mut boxed = with_plan("envelope");
            boxed["contains"] = "all=±40%".into();
            let arguments = [
                "envelope",
                &domain,
                &problem,
                &plan,
                "--contains",
                "all=±40%",
            ];
            assert_same(&arguments, &boxed);
        }
    }
}

#[test]
fn run_with_seed_is_reproducible() {
    let name = |file: &str| format!("cases/delivery/{file}");
    let (domain, problem, plan) = (name("domain.pddl"), name("problem.pddl"), name("plan.plan"));
    let world = name("world.toml");
    for seed in 0..5 {
        let question = json!({
            "ask": "run", "domain": file(&domain), "problem": file(&problem), "plan": file(&plan),
            "world": file(&world), "seed": seed,
        });
        let seed = seed.to_string();
        let trace =
            std::env::temp_dir().join(format!("elbowroom-web-{}.jsonl", std::process::id()));
        let arguments = [
            "run",
            &domain,
            &problem,
            &plan,
            "--world",
            &world,
            "--seed",
            &seed,
            "--trace",
            trace.to_str().unwrap(),
        ];
        let reply = assert_same(&arguments, &question);
        let written = std::fs::read_to_string(&trace).unwrap();
        std::fs::remove_file(&trace).unwrap();
        let trace = reply.trace.expect("a run has a trace");
        assert_eq!(trace, written);
        let page =
            reply_to(&json!({ "ask": "page", "of": { "name": "run.jsonl", "text": trace } }));
        assert!(
            page.page
                .expect("a trace has a page")
                .contains("<!doctype html>")
        );
    }
}

#[test]
fn errors_in_texts_have_the_same_messages() {
    let domain = "crates/cli/tests/files/misspelt.pddl";
    let problem = "cases/delivery/problem.pddl";
    let question = json!({ "ask": "check", "domain": file(domain), "problem": file(problem) });
    let reply = assert_same(&["check", domain, problem], &question);
    assert_eq!(reply.exit, 2);
}

#[test]
fn meaningless_requests_get_a_reply() {
    let domain = json!({ "name": "d", "text": "(define (domain d))" });
    let problem =
        json!({ "name": "p", "text": "(define (problem p) (:domain d) (:init) (:goal (and)))" });
    let plan = json!({ "name": "plan", "text": "" });
    let with = |ask: &str, member: &str, value: Value| {
        let mut question =
            json!({ "ask": ask, "domain": domain, "problem": problem, "plan": plan });
        question[member] = value;
        question
    };
    let questions = [
        json!(null),
        json!({}),
        json!({ "ask": "the moon" }),
        json!({ "ask": "check" }),
        with("check", "plan-of-mine", json!(1)),
        with("check", "epsilon", json!("0")),
        with("check", "epsilon", json!("much")),
        with("check", "tolerance", json!("-1")),
        with("envelope", "contains", json!("dur_0=[")),
        with("envelope", "vary", json!(["nothing of that kind"])),
        with("envelope", "time-limit", json!("soon")),
        with("run", "executor", json!("nobody")),
        with("run", "world", json!({ "name": "w", "text": "[[[" })),
        with("run", "seed", json!(-1)),
        json!({ "ask": "page", "of": { "name": "x", "text": "\u{202e}<script>" } }),
    ];
    for question in questions {
        let reply = reply_to(&question);
        assert_eq!(reply.exit, 2, "{question}: {}", reply.document);
        let document: Value = serde_json::from_str(&reply.document).unwrap();
        assert_eq!(document["format"], "elbowroom-failure", "{question}");
        let is_said = !document["message"].as_str().unwrap().is_empty();
        assert!(is_said, "{question}");
    }
}
