//! All STN plan files of the authors' benchmarks can be read without changes, and so can the files
//! that we write.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "the helpers of a test are part of it"
)]

use crate::shared;
use std::fs;
use std::path::{Path, PathBuf};

use elbowroom::pipeline;
use elbowroom_pddl::read_plan;
use elbowroom_plan::format;

/// Adds all files below the folder, sorted.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
}

fn is_stn_plan(path: &Path) -> bool {
    let name = path.file_name().unwrap().to_string_lossy();
    name.ends_with(".stn") || name.starts_with("stn_plan")
}

/// Returns the domain and the problem for a file, as the folders' READMEs specify.
fn companions(envelopes: &Path, file: &Path) -> (PathBuf, PathBuf) {
    let inside = file.strip_prefix(envelopes).unwrap();
    let folders: Vec<_> = inside
        .parent()
        .unwrap()
        .iter()
        .map(|part| part.to_str().unwrap())
        .collect();
    let name = file.file_name().unwrap().to_str().unwrap();
    let two_digits = || name.trim_start_matches("output")[..2].to_owned();
    let (domain, problem) = match folders[..] {
        ["auv", ..] => {
            let mission: Vec<_> = name.split('_').skip(2).take(4).collect();
            let domain = "auv/domains/pandora_domain_strategic_for_validation.pddl";
            let problem = format!("auv/problems/{}.pddl", mission.join("_"));
            (domain.to_owned(), problem)
        }
        ["generator_linear", ..] => (
            "generator_linear/gen_linear_domain.pddl".to_owned(),
            format!("generator_linear/gen_linear_prob{}.pddl", two_digits()),
        ),
        ["solar_rover", version, ..] => (
            format!("solar_rover/{version}/solarrover_linear.pddl"),
            format!("solar_rover/{version}/prob{}.pddl", two_digits()),
        ),
        ["robot_delivery", scalability, stns] => {
            let problem = name
                .trim_start_matches("STN_plan_")
                .replace(".stn", ".pddl");
            if stns == "stn_no_params" {
                (
                    format!("robot_delivery/{scalability}/domain_no_deadline.pddl"),
                    format!("robot_delivery/{scalability}/problems_no_deadline/{problem}"),
                )
            } else {
                (
                    "robot_delivery/domain_robot_delivery.pddl".to_owned(),
                    format!("robot_delivery/{scalability}/problems_deadline/{problem}"),
                )
            }
        }
        ["ccmmz_examples", example] => example_files(example),
        ["golden_reference_runs", "rcll"] => (
            "rcll_duration/domain_rcll_simple_robust.pddl".to_owned(),
            "rcll_duration/problems/problem_lp0.05_hp0.95.pddl".to_owned(),
        ),
        ["golden_reference_runs", "robot_delivery"] => (
            "golden_reference_runs/robot_delivery/domain_robot_delivery_goto_relaxed.pddl"
                .to_owned(),
            "robot_delivery/scalability/problems_deadline/problem_g01_w04_ROSPlan.pddl".to_owned(),
        ),
        ["golden_reference_runs"] => example_files(match name.split('_').next().unwrap() {
            "genlin" => "generator_linear",
            "geninst" => "generator_instantaneous_action",
            other => other,
        }),
        _ => panic!("nobody said which problem goes with {}", file.display()),
    };
    (envelopes.join(domain), envelopes.join(problem))
}

fn example_files(example: &str) -> (String, String) {
    let prefix = if example.starts_with("generator") {
        ("gen_linear_domain", "gen_linear_prob01")
    } else {
        ("domain", "problem")
    };
    (
        format!("ccmmz_examples/{example}/{}.pddl", prefix.0),
        format!("ccmmz_examples/{example}/{}.pddl", prefix.1),
    )
}

#[test]
fn benchmark_stn_files_round_trip() {
    let Some(data) = shared::data() else {
        return;
    };
    let envelopes = data.join("envelopes");
    let mut found = Vec::new();
    files(&envelopes, &mut found);
    found.retain(|path| is_stn_plan(path));
    let mut mistakes = Vec::new();
    let mut without_problem = 0;
    for path in &found {
        let (domain, problem) = companions(&envelopes, path);
        if !problem.exists() {
            // A part of the benchmarks is missing.
            println!("no problem file for {}", path.display());
            without_problem += 1;
            continue;
        }
        let task = match shared::task(&domain, &problem) {
            Ok(task) => task,
            Err(error) => {
                mistakes.push(error);
                continue;
            }
        };
        match format::read(&fs::read(path).unwrap(), &task) {
            Ok(plan) => {
                let text = format::write(&task, &plan).unwrap();
                let again = format::read(text.as_bytes(), &task).unwrap();
                assert_eq!(again, plan, "{}", path.display());
            }
            Err(errors) => mistakes.push(format!("{}: {errors}", path.display())),
        }
    }
    println!(
        "{} STN plan files, {without_problem} without their problem",
        found.len()
    );
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

/// The networks and parameters of the project's cases are the same after writing and reading, like
/// those of the benchmarks.
#[test]
fn networks_of_own_plans_round_trip() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let mut count = 0;
    for entry in fs::read_dir(cases).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.join("plan.plan").exists() {
            continue;
        }
        let task = shared::task(&folder.join("domain.pddl"), &folder.join("problem.pddl")).unwrap();
        let (plan, _) = read_plan(&shared::source(&folder.join("plan.plan")), &task).unwrap();
        let plan = pipeline::open(&task, pipeline::free(&task, &plan).unwrap(), &[]).unwrap();
        let text = format::write(&task, &plan).unwrap();
        let again = format::read(text.as_bytes(), &task).unwrap();
        assert_eq!(again.parameters.len(), plan.parameters.len());
        assert_eq!(again.nominal(), plan.nominal(), "{text}");
        assert_eq!(format::write(&task, &again).unwrap(), text);
        count += 1;
    }
    assert!(count >= 7, "only {count} were compared");
}
