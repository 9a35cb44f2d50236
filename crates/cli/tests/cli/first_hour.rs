//! Mistakes of the first hour with the command, and the messages about them.

use std::fs;
use std::path::PathBuf;

use crate::command::{elbowroom, root};

/// Runs the command, checks its exit code, and returns standard output and standard error.
fn said(code: i32, arguments: &[&str]) -> String {
    let output = elbowroom(arguments);
    assert_eq!(
        output.status.code(),
        Some(code),
        "{arguments:?}: {output:?}"
    );
    let text = [output.stdout, output.stderr].concat();
    String::from_utf8(text).expect("text")
}

/// Writes a file that no other test uses.
fn file(name: &str, content: &str) -> PathBuf {
    let name = format!("elbowroom-{}-hour-{name}", std::process::id());
    let path = std::env::temp_dir().join(name);
    fs::write(&path, content).expect("a temporary file can be written");
    path
}

const DOMAIN: &str = "cases/delivery/domain.pddl";
const PROBLEM: &str = "cases/delivery/problem.pddl";
const PLAN: &str = "cases/delivery/plan.plan";

#[test]
fn suggested_objects_are_spelt_as_in_the_files() {
    let problem = fs::read_to_string(root().join(PROBLEM)).expect("the problem");
    let problem = problem.replace("shelf", "ShelfA");
    let wrong = problem.replace("(lies parcel ShelfA)", "(lies parcel shelfB)");
    let path = file("spelling.pddl", &wrong);
    let text = said(2, &["check", DOMAIN, path.to_str().expect("text")]);
    assert!(text.contains("did you mean `ShelfA`?"), "{text}");
    let path = file("spelling.pddl", &problem);
    let plan = file("spelling.plan", "0: (drive rover depot shelfB) [10]\n");
    let (path, plan) = (path.to_str().expect("text"), plan.to_str().expect("text"));
    let text = said(2, &["check", DOMAIN, path, plan]);
    assert!(text.contains("did you mean `ShelfA`?"), "{text}");
}

#[test]
fn action_name_in_contains_means_all_of_its_durations() {
    let of = |contains| {
        said(
            0,
            &["envelope", DOMAIN, PROBLEM, PLAN, "--contains", contains],
        )
    };
    assert_eq!(of("drive=[9,12]"), of("dur_0=[9,12] dur_3=[9,12]"));
    // More specific names prevail over less specific ones.
    assert_eq!(
        of("drive=[9,12] dur_3=[14,16] all=±10%"),
        of("dur_0=[9,12] dur_3=[14,16] dur_1=±10% dur_2=±10% dur_4=±10%")
    );
    let twice = [
        "envelope",
        DOMAIN,
        PROBLEM,
        PLAN,
        "--contains",
        "drive=1 DRIVE=2",
    ];
    assert!(said(2, &twice).contains("is given two intervals"));
}

#[test]
fn missing_world_programs_are_named() {
    for (program, words) in [
        (
            "nosuch --fast",
            "there is no program `nosuch` on the search path",
        ),
        ("./nosuch", "there is no such file"),
    ] {
        let text = said(
            2,
            &["run", DOMAIN, PROBLEM, PLAN, "--world-process", program],
        );
        assert!(text.contains(words), "{text}");
        let text = said(2, &["world-check", program]);
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn tables_with_other_separators_and_outcomes_get_advice() {
    let table = "action,start,end,outcome\n(drive rover depot shelf),0,11,ok\n";
    for (content, words) in [
        (
            table.replace(',', ";"),
            "separated by semicolons, expected commas",
        ),
        (
            table.replace(',', "\t"),
            "separated by tabs, expected commas",
        ),
        (table.to_owned(), "did you mean `succeeded`?"),
    ] {
        let path = file("log.csv", &content);
        let text = said(2, &["learn", path.to_str().expect("text")]);
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn fractions_are_numbers_of_world_files() {
    let world = |value: &str| {
        let content = format!(
            "format = \"elbowroom-world\"\nversion = 1\nresolution = \"1/3\"\n
             [[duration]]\naction = \"drive\"\nconstant = {value}\n"
        );
        file("fraction.toml", &content)
    };
    let path = world("\"13/3\"");
    let path = path.to_str().expect("text");
    let run = ["run", DOMAIN, PROBLEM, PLAN, "--world", path, "--json"];
    let document: serde_json::Value = serde_json::from_str(&said(0, &run)).expect("a document");
    let text = document.to_string();
    assert!(text.contains("\"13/3\""), "{text}");
    let path = world("\"a third\"");
    let path = path.to_str().expect("text");
    let text = said(2, &["run", DOMAIN, PROBLEM, PLAN, "--world", path]);
    assert!(
        text.contains("a number, or a fraction such as \"13/3\""),
        "{text}"
    );
}

#[test]
fn lost_object_of_a_failure_points_to_undone() {
    for (undone, is_advised) in [("", true), ("undone = true\n", false)] {
        let path = file(
            "lost.toml",
            &format!(
                "format = \"elbowroom-world\"\nversion = 1\n
                 [[failure]]\naction = \"pick\"\nprobability = 1\n{undone}"
            ),
        );
        let run = [
            "run",
            DOMAIN,
            PROBLEM,
            PLAN,
            "--world",
            path.to_str().expect("text"),
        ];
        let output = elbowroom(&run);
        assert_ne!(output.status.code(), Some(0), "{output:?}");
        let text = String::from_utf8(output.stderr).expect("text");
        assert_eq!(text.contains("`undone = true`"), is_advised, "{text}");
    }
}

#[test]
fn experiment_without_title_is_named_like_its_file() {
    let case = root()
        .join("cases/delivery")
        .canonicalize()
        .expect("the case");
    let case = case.display();
    let path = file(
        "untitled.toml",
        &format!(
            "format = \"elbowroom-experiment\"\nversion = 1\ntrials = 1\nseed = 1\n\
             domain = \"{case}/domain.pddl\"\nproblem = \"{case}/problem.pddl\"\n\
             plan = \"{case}/plan.plan\"\nexecutors = [\"stn\"]\n\
             [[column]]\nname = \"a\"\nworld = \"{case}/slips.toml\"\n"
        ),
    );
    let text = said(0, &["compare", path.to_str().expect("text")]);
    assert!(text.contains("hour-untitled (1 trial"), "{text}");
}

#[test]
fn habits_of_other_programs_are_answered() {
    let text = said(2, &["check", "-v", DOMAIN, PROBLEM, PLAN]);
    assert!(text.contains("elbowroom val -v"), "{text}");
    assert_eq!(said(0, &["version"]), said(0, &["--version"]));
}
