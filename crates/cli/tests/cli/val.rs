//! `elbowroom val` under VAL's name, compared with recorded verdicts of VAL.

use crate::command;
use std::path::PathBuf;
use std::process::Command;

use crate::command::elbowroom;
use crate::skipped::skipped;

/// Plans whose domains have processes or events, which are not supported here.
const NOT_READ: [&str; 3] = ["coffee", "sleeping-beauty", "vendingmachine"];

/// Returns the folder of the benchmark set; `None` if it is not installed.
fn benchmarks() -> Option<PathBuf> {
    let shared = std::env::var_os("ELBOWROOM_SHARED")
        .map_or_else(|| command::root().join("../shared"), PathBuf::from);
    let root = shared.join("data/pddl");
    root.join("plans.csv").is_file().then_some(root)
}

/// Uses the tolerance at which the validator and VAL agree on all plans (`docs/research/val-agreement.md`).
#[test]
fn output_has_the_phrases_of_val() {
    let Some(root) = benchmarks() else {
        skipped("no benchmark set; set ELBOWROOM_SHARED to where it is");
        return;
    };
    let table = std::fs::read_to_string(root.join("plans.csv")).expect("checked above");
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let column = |name: &str| header.iter().position(|it| *it == name).expect("a column");
    let files = ["domain_file", "problem_file", "plan_file"].map(column);
    let verdict = column("val_t1e-3");
    let mut judged = 0;
    for row in lines {
        if NOT_READ.iter().any(|name| row[files[2]].contains(name)) {
            continue;
        }
        let paths = files.map(|column| root.join(row[column]).display().to_string());
        let answer = elbowroom(&["val", "-t", "0.001", &paths[0], &paths[1], &paths[2]]);
        let text = String::from_utf8_lossy(&answer.stdout);
        let says = |words: &str| text.contains(words);
        match row[verdict] {
            "valid" => assert!(
                says("Plan valid") && says("Successful plans:"),
                "{}: {text}",
                paths[2]
            ),
            "failed-to-execute" => {
                let failed = says("Plan failed to execute") || says("Goal not satisfied");
                assert!(failed && says("Failed plans:"), "{}: {text}", paths[2]);
            }
            _ => assert!(!says("Plan valid"), "{}: {text}", paths[2]),
        }
        assert_eq!(
            answer.status.success(),
            row[verdict] == "valid",
            "{}",
            paths[2]
        );
        judged += 1;
    }
    assert!(judged > 150, "{judged} plans");
}

/// These plans keep interfering happenings 0.001 apart.
#[test]
fn valid_plans_of_all_cases_are_accepted_by_default() {
    let files = |folder: PathBuf| {
        let entries = std::fs::read_dir(folder).expect("a folder");
        entries.filter_map(|entry| Some(entry.ok()?.path()))
    };
    let cases = files(command::root().join("cases"));
    let plans = cases
        .flat_map(files)
        .filter(|path| path.extension().is_some_and(|it| it == "plan"));
    let mut accepted = 0;
    for plan in plans {
        let [domain, problem] =
            ["domain.pddl", "problem.pddl"].map(|it| plan.with_file_name(it).display().to_string());
        let plan = plan.display().to_string();
        let is_valid = elbowroom(&["check", &domain, &problem, &plan])
            .status
            .success();
        let answer = elbowroom(&["val", &domain, &problem, &plan]);
        let text = String::from_utf8_lossy(&answer.stdout);
        assert_eq!(text.contains("Plan valid"), is_valid, "{plan}: {text}");
        accepted += usize::from(is_valid);
    }
    assert!(accepted >= 9, "{accepted} plans are valid");
}

#[test]
fn times_equal_within_tolerance_are_named() {
    let case =
        ["domain.pddl", "problem.pddl", "plan.plan"].map(|it| format!("cases/delivery/{it}"));
    let said = |tolerance: &str| {
        let answer = elbowroom(&["val", "-t", tolerance, &case[0], &case[1], &case[2]]);
        String::from_utf8_lossy(&answer.stderr).into_owned()
    };
    let coarse = said("0.01");
    assert!(
        coarse.contains("times 10 and 10.001 count as equal at -t 0.01"),
        "{coarse}"
    );
    assert!(coarse.contains("try -t 0.001"), "{coarse}");
    assert_eq!(said("0.001"), "");
}

#[cfg(unix)]
#[test]
fn command_named_validate_accepts_arguments_of_val() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("val");
    std::fs::create_dir_all(&folder).expect("a folder");
    for name in ["Validate", "validate"] {
        let link = folder.join(name);
        let _ = std::fs::remove_file(&link);
        std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_elbowroom"), &link).expect("a link");
        let case = |file: &str| format!("cases/delivery/{file}");
        let judged = |options: &[&str]| {
            let answer = Command::new(&link)
                .current_dir(command::root())
                .args(options)
                .args(["domain.pddl", "problem.pddl", "plan.plan"].map(case))
                .output()
                .expect("the command can be started");
            String::from_utf8_lossy(&answer.stdout).into_owned()
        };
        // 10 and 10.001 count as equal at VAL's default tolerance.
        let text = judged(&[]);
        assert!(text.contains("Plan failed to execute"), "{text}");
        let text = judged(&["-v", "-t", "0.001"]);
        assert!(text.contains("Plan valid"), "{text}");
        assert!(
            text.contains("Checking next happening (time 10.001)"),
            "{text}"
        );
    }
}
