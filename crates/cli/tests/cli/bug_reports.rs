//! Regression tests based on public bug reports, questions and domains: each input gets the right
//! answer (`bug_reports/expected.txt`).

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::skipped::skipped;

const EXPECTED: &str = include_str!("bug_reports/expected.txt");

/// Maximum number of decimal digits in a printed plan.
const MAX_DIGITS: usize = 9;

/// Expected answer of one command.
struct Expectation {
    arguments: Vec<String>,
    exits: Vec<i32>,
    /// Words that the answer must contain, or must not contain (`false`).
    words: Option<(String, bool)>,
}

/// Returns the folder of the inputs; `None` if it is not installed.
fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("ELBOWROOM_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let folder = shared.join("data/bug-reports").canonicalize().ok();
    if folder.is_none() {
        skipped("no inputs of bug reports; set ELBOWROOM_SHARED to where they are");
    }
    folder
}

/// Returns the expectations by folder; `None` for folders that are tested elsewhere.
fn expectations() -> BTreeMap<String, Option<Vec<Expectation>>> {
    let mut folders = BTreeMap::new();
    let mut current = String::new();
    for line in EXPECTED.lines().map(str::trim) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if let Some(name) = line.strip_prefix('[') {
            name.trim_end_matches(']').clone_into(&mut current);
            folders.insert(current.clone(), Some(Vec::new()));
        } else if line.starts_with("elsewhere: ") {
            folders.insert(current.clone(), None);
        } else if let Some(Some(expected)) = folders.get_mut(&current) {
            expected.extend(expectation(line));
        }
    }
    folders
}

fn expectation(line: &str) -> Vec<Expectation> {
    let exits = |text: &str| -> Vec<i32> {
        let exits = text
            .split('|')
            .map(|exit| exit.parse().expect("an exit code"));
        exits.collect()
    };
    let expect = |code: &str, arguments: &str, words| Expectation {
        arguments: arguments.split_whitespace().map(str::to_owned).collect(),
        exits: exits(code),
        words,
    };
    let (codes, rest) = line.split_once("  ").expect("codes, two spaces, a command");
    if let Some(name) = rest.trim().strip_prefix("variant ") {
        let (check, plan) = codes.split_once(' ').expect("two codes");
        let problem = format!("{name}.d.pddl {name}.p.pddl");
        return vec![
            expect(check, &format!("check {problem} {name}.x.plan"), None),
            expect(plan, &format!("plan {problem} --time-limit 5"), None),
        ];
    }
    let (arguments, words) = match rest.split_once(" => ") {
        Some((arguments, words)) => (arguments, Some(words)),
        None => (rest, None),
    };
    let words = words.map(|words| match words.strip_prefix('!') {
        Some(words) => (words.to_owned(), false),
        None => (words.to_owned(), true),
    });
    vec![expect(codes, arguments, words)]
}

/// Runs the command in a folder. `{out}` in its arguments is an output file.
fn run(folder: &Path, arguments: &[String], written: &Path) -> (i32, String) {
    let written = written.display().to_string();
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .args(arguments.iter().map(|it| it.replace("{out}", &written)))
        .output()
        .expect("the command can be started");
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    (output.status.code().unwrap_or(-1), text.concat())
}

/// Returns the difference between the answer of one command and the expectation.
fn objection(folder: &Path, expected: &Expectation, written: &Path) -> Option<String> {
    let _ = std::fs::remove_file(written);
    let mut arguments = expected.arguments.clone();
    let is_plan = arguments[0] == "plan";
    if is_plan {
        arguments.extend(["-o".to_owned(), "{out}".to_owned()]);
    }
    let (exit, text) = run(folder, &arguments, written);
    if !expected.exits.contains(&exit) {
        return Some(format!("exit {exit}, not {:?}:\n{text}", expected.exits));
    }
    if let Some((words, is_wanted)) = &expected.words
        && text.contains(words.as_str()) != *is_wanted
    {
        let what = if *is_wanted { "lacks" } else { "has" };
        return Some(format!("the answer {what} `{words}`:\n{text}"));
    }
    let verdict = match (arguments[0].as_str(), exit) {
        ("check", 0) => "valid: ",
        ("check", 1) => "invalid: ",
        ("val", 0) => "Plan valid",
        ("val", 1) => "Failed plans",
        ("plan", 1) => "no plan exists",
        ("plan", 3) => "no plan found",
        _ => "",
    };
    if !text.contains(verdict) {
        return Some(format!("the answer lacks `{verdict}`:\n{text}"));
    }
    if is_plan && exit == 0 {
        return objection_to_plan(folder, &arguments[1..3], written);
    }
    None
}

/// Returns the fault of a written plan. A plan must be valid, and readable by other tools.
fn objection_to_plan(folder: &Path, problem: &[String], written: &Path) -> Option<String> {
    let plan = std::fs::read_to_string(written).expect("the plan was written");
    for line in plan.lines().filter(|line| !line.starts_with(';')) {
        let (time, rest) = line.split_once(": (").unwrap_or((line, ""));
        let duration = rest
            .split_once('[')
            .map_or("0", |(_, it)| it.trim_end_matches(']'));
        for number in [time, duration] {
            let digits = number.split_once('.').map_or(0, |(_, digits)| digits.len());
            let is_decimal = number
                .bytes()
                .all(|byte| byte.is_ascii_digit() || byte == b'.');
            if !is_decimal || digits > MAX_DIGITS {
                return Some(format!("other tools do not read `{number}`:\n{plan}"));
            }
        }
    }
    let check = ["check".to_owned(), problem[0].clone(), problem[1].clone()];
    let (exit, text) = run(
        folder,
        &[&check[..], &["{out}".to_owned()]].concat(),
        written,
    );
    (exit != 0).then(|| format!("the plan is not valid:\n{plan}{text}"))
}

#[test]
fn each_folder_has_an_expectation() {
    let Some(folder) = folder() else {
        return;
    };
    let entries = std::fs::read_dir(&folder).expect("the folder can be read");
    let found: BTreeSet<String> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir())
        .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
        .collect();
    let expected: BTreeMap<_, _> = expectations();
    let missing: Vec<_> = found
        .iter()
        .filter(|it| !expected.contains_key(*it))
        .collect();
    assert!(missing.is_empty(), "without expectation: {missing:?}");
    let gone: Vec<_> = expected.keys().filter(|it| !found.contains(*it)).collect();
    assert!(gone.is_empty(), "expected, but not there: {gone:?}");
    for (name, expected) in &expected {
        let is_empty = expected.as_ref().is_some_and(Vec::is_empty);
        assert!(!is_empty, "{name} has no command");
    }
}

#[test]
fn inputs_of_bug_reports_are_answered_correctly() {
    let Some(folder) = folder() else {
        return;
    };
    let written = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("bug-report.out");
    let mut wrong = Vec::new();
    for (name, expected) in expectations() {
        let objections = expected.into_iter().flatten().filter_map(|it| {
            let objection = objection(&folder.join(&name), &it, &written)?;
            let command = it.arguments.join(" ");
            Some(format!("{name}: elbowroom {command}: {objection}"))
        });
        wrong.extend(objections);
    }
    assert!(
        wrong.is_empty(),
        "{} wrong answers\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}
