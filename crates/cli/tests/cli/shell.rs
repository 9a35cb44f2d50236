//! Shell integration: completions, manual pages, colours.

use std::fs;

use crate::command::elbowroom;

fn stdout_and_stderr(arguments: &[&str]) -> (String, String) {
    let output = elbowroom(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (text(output.stdout), text(output.stderr))
}

#[test]
fn each_shell_gets_its_completions() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let (script, _) = stdout_and_stderr(&["completions", shell]);
        for word in ["envelope", "--precision", "--world-process"] {
            let word = word.trim_start_matches('-');
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}

#[test]
fn every_command_has_a_man_page() {
    let (page, _) = stdout_and_stderr(&["man"]);
    assert!(page.contains(".TH elbowroom 1"), "{page}");
    let folder = std::env::temp_dir().join(format!("elbowroom-man-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    stdout_and_stderr(&["man", &folder.display().to_string()]);
    for command in [
        "check", "plan", "stn", "envelope", "run", "compare", "network",
    ] {
        let page = folder.join(format!("elbowroom-{command}.1"));
        assert!(page.is_file(), "{}", page.display());
    }
    fs::remove_dir_all(folder).expect("it was there");
}

#[test]
fn colours_can_be_forced_and_disabled() {
    let check = [
        "check",
        "cases/delivery/domain.pddl",
        "cases/delivery/problem.pddl",
        "cases/delivery/plan.plan",
    ];
    for (when, expected) in [("always", true), ("never", false), ("auto", false)] {
        let (text, _) = stdout_and_stderr(&[&check[..], &["--color", when]].concat());
        assert_eq!(text.contains('\u{1b}'), expected, "{when}: {text}");
    }
}

/// The answer of `check` contains the plan's metric.
#[test]
fn metric_is_reported() {
    let folder = std::env::temp_dir().join(format!("elbowroom-metric-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).expect("a file can be written");
        path.display().to_string()
    };
    let domain = file(
        "domain.pddl",
        "(define (domain shop) (:requirements :durative-actions :fluents)
          (:predicates (done)) (:functions (cost))
          (:durative-action work :parameters () :duration (= ?duration 4)
            :condition () :effect (and (at end (done)) (at end (increase (cost) 3)))))",
    );
    let problem = file(
        "problem.pddl",
        "(define (problem p) (:domain shop) (:init (= (cost) 0)) (:goal (done))
          (:metric minimize (+ (* 2 (cost)) (total-time))))",
    );
    let plan = file("a.plan", "1: (work) [4]\n");
    let (text, _) = stdout_and_stderr(&["check", &domain, &problem, &plan]);
    assert!(text.contains("metric: 11"), "{text}");
    let (json, _) = stdout_and_stderr(&["check", &domain, &problem, &plan, "--json"]);
    let document: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(document["metric"]["exact"], "11", "{document}");
    // The document also contains warnings.
    let lenient = file("lenient.plan", "1: (work) [4 min]\n");
    let (json, said) = stdout_and_stderr(&["check", &domain, &problem, &lenient, "--json"]);
    let document: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert!(said.contains("`min` is ignored"), "{said}");
    assert_eq!(
        document["diagnostics"][0]["severity"], "warning",
        "{document}"
    );
    fs::remove_dir_all(folder).expect("it was there");
}
