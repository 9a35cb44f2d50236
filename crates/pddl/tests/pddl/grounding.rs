//! Grounds the benchmark set, if it is available.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::skipped::skipped;
use elbowroom_model::Task;
use elbowroom_model::reachability::{Answer, Settings, ground};
use elbowroom_pddl::{Source, read_plan, read_problem};

/// Returns `pddl` in the folder that `ELBOWROOM_SHARED` names, or next to the workspace.
fn benchmarks() -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let shared = std::env::var_os("ELBOWROOM_SHARED").map_or(beside.into(), PathBuf::from);
    // Both layouts: the data folder itself, or its parent.
    let folder = [shared.join("data/pddl"), shared.join("pddl")]
        .into_iter()
        .find(|folder| folder.join("manifest.csv").exists());
    if folder.is_none() {
        skipped(format_args!("no benchmarks in {}", shared.display()));
    }
    folder
}

fn rows(folder: &Path, table: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(folder.join(table)).expect("a table");
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(String::from).collect())
        .collect()
}

fn load(folder: &Path, path: &str) -> Source {
    Source::from_bytes(
        path,
        &std::fs::read(folder.join(path)).expect("a file of the table"),
    )
}

fn read(folder: &Path, domain: &str, problem: &str) -> Option<Task> {
    let (domain, problem) = (load(folder, domain), load(folder, problem));
    let (problem, _) = read_problem(&domain, &problem).ok()?;
    Some(Task::new(problem))
}

#[test]
fn readable_instances_are_grounded_within_limits() {
    let Some(folder) = benchmarks() else { return };
    let (mut grounded, mut hopeless) = (0, Vec::new());
    for row in rows(&folder, "manifest.csv") {
        let Some(task) = read(&folder, &row[3], &row[4]) else {
            continue;
        };
        let Answer::Complete(grounding) = ground(&task, &Settings::default()) else {
            panic!("{} passes a limit", row[4]);
        };
        grounded += 1;
        // The actions of the published domain cannot achieve the goals of these instances.
        let is_known = row[4].starts_with("upf-concurrency/allen-algebra/");
        if !grounding.unreachable_goals.is_empty() && !is_known {
            hopeless.push(row[4].clone());
        }
    }
    assert!(grounded > 700, "only {grounded} instances could be read");
    assert_eq!(
        hopeless,
        [
            "rosplan/test_domain/instances/test_problem_no_solution.pddl",
            // The car is horizontal, but the goal requires another row.
            "tfd/rushhour/instances/p03.pddl",
            // Nothing moves a package.
            "unified-planning/object_fluents/instances/problem.pddl",
            // Nothing selects the second fastener.
            "unified-planning/robot_fastener/instances/problem.pddl",
        ]
    );
}

#[test]
fn each_action_of_a_valid_plan_is_grounded() {
    let Some(folder) = benchmarks() else { return };
    let mut compared = 0;
    for row in rows(&folder, "plans.csv") {
        if !row[8..].iter().any(|verdict| verdict == "valid") {
            continue;
        }
        let Some(task) = read(&folder, &row[3], &row[4]) else {
            continue;
        };
        let Ok((plan, _)) = read_plan(&load(&folder, &row[5]), &task) else {
            continue;
        };
        let Answer::Complete(grounding) = ground(&task, &Settings::default()) else {
            panic!("{} passes a limit", row[4]);
        };
        let names: BTreeSet<_> = grounding
            .actions
            .iter()
            .map(|action| &action.name)
            .collect();
        for step in &plan.steps {
            assert!(
                names.contains(&step.action.name),
                "{} of {}",
                step.action.name,
                row[5]
            );
        }
        compared += 1;
    }
    assert!(compared > 50, "only {compared} plans could be compared");
}

/// Checks the property of the benchmark test on the cases of the repository.
#[test]
fn each_action_of_own_plans_is_grounded() {
    let cases = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../cases"));
    let mut compared = 0;
    for entry in std::fs::read_dir(&cases).expect("the cases") {
        let folder = entry.expect("an entry").path();
        let task = read(&folder, "domain.pddl", "problem.pddl");
        let task = task.unwrap_or_else(|| panic!("{}", folder.display()));
        let Answer::Complete(grounding) = ground(&task, &Settings::default()) else {
            panic!("{} passes a limit", folder.display());
        };
        assert!(
            grounding.unreachable_goals.is_empty(),
            "{}",
            folder.display()
        );
        if !folder.join("plan.plan").exists() {
            continue;
        }
        let (plan, _) = read_plan(&load(&folder, "plan.plan"), &task).expect("a plan");
        for step in &plan.steps {
            let mut actions = grounding.actions.iter();
            let name = &step.action.name;
            assert!(actions.any(|action| action.name == *name), "{name}");
        }
        compared += 1;
    }
    assert!(compared >= 7, "only {compared} plans were compared");
}
