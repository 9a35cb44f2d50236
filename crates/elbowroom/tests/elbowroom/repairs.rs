//! Cheapest repairs of plans, in comparison with brute force, and for all invalid plans of the
//! benchmarks.

#![allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "counts and times are worth seeing; nothing depends on them"
)]

mod optimality;

use crate::shared;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use elbowroom::answers::repair::{RepairFinding, RepairOutcome, RepairRequest, repair};
use elbowroom::answers::{EnvelopeRequest, NoObserver, envelope};
use elbowroom::envelope::Guarantee;
use elbowroom::model::{Task, validate};
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_plan, read_problem};
use elbowroom::plan::format;
use elbowroom::{AnyPlan, PlanKind};

fn case(name: &str, problem: &dyn Fn(String) -> String, plan: &str) -> RepairRequest {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(name);
    let read =
        |file: &str| std::fs::read_to_string(folder.join(file)).expect("a case has this file");
    let domain = Source::new("domain", read("domain.pddl"));
    let problem = Source::new("problem", problem(read("problem.pddl")));
    let (problem, _) = read_problem(&domain, &problem).expect("a problem");
    let task = Arc::new(Task::new(problem));
    let plan = if plan.is_empty() {
        read("plan.plan")
    } else {
        plan.to_owned()
    };
    let plan = any_plan(&task, &plan).expect("a plan of the case");
    RepairRequest::new(&task, plan)
}

fn any_plan(task: &Task, text: &str) -> Option<AnyPlan> {
    match PlanKind::of_text(text) {
        PlanKind::Stn => format::read(text.as_bytes(), task).ok().map(AnyPlan::from),
        PlanKind::TimeTriggered => {
            let (plan, _) = read_plan(&Source::new("plan", text), task).ok()?;
            Some(plan.into())
        }
    }
}

/// Returns `deadline …: 120 instead of 100` for each change, or why there is no repair.
fn repair_text(request: &RepairRequest) -> String {
    let outcome = repair(request, &mut NoObserver).expect("within reach");
    verified(&outcome);
    match outcome.answer.finding {
        RepairFinding::Repaired {
            changes,
            not_guaranteed,
            ..
        } => {
            assert_eq!(not_guaranteed, None);
            let changes = changes.iter().map(|change| {
                let number = |value: &Rational| value.to_decimal(6);
                format!(
                    "{}: {} instead of {}",
                    change.quantity,
                    number(&change.to),
                    number(&change.from)
                )
            });
            changes.collect::<Vec<_>>().join("\n")
        }
        RepairFinding::Impossible { because, .. } => because.join("\n"),
        RepairFinding::None { reason, .. } => panic!("{reason}"),
    }
}

/// Checks that the validator accepts the plan for the changed problem.
fn verified(outcome: &RepairOutcome) {
    if let Some((task, plan)) = &outcome.repaired {
        let verdict = validate(task, plan, &validate::Settings::default());
        assert!(verdict.is_valid(), "{verdict:?}");
    }
}

fn closing_at(time: &'static str) -> impl Fn(String) -> String {
    move |problem| problem.replace("(at 60 (not", &format!("(at {time} (not"))
}

#[test]
fn early_deadline_moves_by_the_least_amount() {
    let request = case("delivery", &closing_at("25"), "");
    // 10 + 2 + 15 + 3 and three separations; the counter closes ε after the end.
    assert_eq!(
        repair_text(&request),
        "deadline of (counter-open office): 30.004 instead of 25"
    );
}

#[test]
fn fixed_deadline_shortens_a_duration() {
    let mut request = case("delivery", &closing_at("25"), "");
    request.keep = vec![
        "deadline (counter-open office)"
            .parse()
            .expect("a quantity"),
    ];
    request.change = ["duration drive", "duration pick weight 1/2 in [1, 2]"]
        .map(|spec| spec.parse().expect("a quantity"))
        .into();
    let outcome = repair(&request, &mut NoObserver).expect("within reach");
    verified(&outcome);
    let RepairFinding::Repaired { cost, changes, .. } = outcome.answer.finding else {
        panic!("{:?}", outcome.answer.finding);
    };
    // One second of the pick at half the price, and 4.004 s of the drives.
    assert_eq!(cost, "4504/1000".parse().expect("a number"));
    assert!(
        changes.iter().any(|change| change.to == Rational::ONE),
        "{changes:?}"
    );
}

#[test]
fn plan_with_wrong_times_needs_no_change() {
    let late = "0: (drive rover depot shelf) [10] 0: (unlock office) [6]
        10.001: (pick rover parcel shelf) [2] 52.002: (drive rover shelf office) [15]
        67.003: (drop rover parcel office) [3]";
    let request = case("delivery", &|problem| problem, &late.replace("] ", "]\n"));
    assert_eq!(repair_text(&request), "");
}

#[test]
fn unachievable_fact_is_named() {
    let request = case(
        "delivery",
        &|problem| problem,
        "0: (drive rover depot shelf) [10]",
    );
    assert_eq!(
        repair_text(&request),
        "the goal (lies parcel office) must hold at the end, which nothing in the plan makes true"
    );
}

#[test]
fn kept_quantities_do_not_change_even_without_repair() {
    let mut request = case("delivery", &closing_at("25"), "");
    request.change = vec!["duration unlock".parse().expect("a quantity")];
    let outcome = repair(&request, &mut NoObserver).expect("within reach");
    assert!(matches!(
        outcome.answer.finding,
        RepairFinding::Impossible { .. }
    ));
}

#[test]
fn no_change_on_a_grid_is_cheaper() {
    optimality::compare();
}

/// Files of a benchmark plan.
struct Files {
    domain: PathBuf,
    problem: PathBuf,
    plan: PathBuf,
}

fn benchmarks(data: &Path) -> Vec<Files> {
    let table = std::fs::read_to_string(data.join("pddl/plans.csv")).expect("a table of plans");
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let columns = ["domain_file", "problem_file", "plan_file"].map(|name| {
        header
            .iter()
            .position(|own| *own == name)
            .expect("a column of this name")
    });
    let mut files: Vec<Files> = lines
        .map(|cells| {
            let [domain, problem, plan] = columns.map(|at| data.join("pddl").join(cells[at]));
            Files {
                domain,
                problem,
                plan,
            }
        })
        .collect();
    let mut instances = shared::instances::figure_4(data);
    instances.extend(shared::instances::figure_3(data));
    files.extend(instances.into_iter().map(|own| Files {
        domain: own.domain,
        problem: own.problem,
        plan: own.plan,
    }));
    let auv = data.join("envelopes/auv");
    let names = std::fs::read_dir(auv.join("stns")).expect("a folder of plans");
    let names = names.map(|entry| {
        entry
            .expect("readable")
            .file_name()
            .to_string_lossy()
            .into_owned()
    });
    files.extend(names.map(|name| {
        let (mission, _) = name.rsplit_once("_var").expect("stn_plan_MISSION_varNN");
        let mission = mission.trim_start_matches("stn_plan_");
        Files {
            domain: auv.join("domains/pandora_domain_strategic_for_validation.pddl"),
            problem: auv.join(format!("problems/{mission}.pddl")),
            plan: auv.join("stns").join(&name),
        }
    }));
    let deliveries = data.join("envelopes/robot_delivery/scalability");
    let names = std::fs::read_dir(deliveries.join("plans_deadline")).expect("a folder of plans");
    let names = names.map(|entry| {
        entry
            .expect("readable")
            .file_name()
            .to_string_lossy()
            .into_owned()
    });
    files.extend(names.map(|name| {
        Files {
            domain: data.join("envelopes/robot_delivery/domain_robot_delivery.pddl"),
            problem: deliveries
                .join("problems_deadline")
                .join(name.trim_start_matches("plan_")),
            plan: deliveries.join("plans_deadline").join(&name),
        }
    }));
    files.sort_by(|a, b| a.plan.cmp(&b.plan));
    files
}

/// Returns `true` if the plan has an envelope with at least its nominal values, or `None` if it is
/// beyond exact analysis.
fn works(request: &RepairRequest) -> Option<bool> {
    let mut asked = EnvelopeRequest::new(&request.task, request.plan.clone());
    asked.guarantee = Guarantee::Weak;
    asked.contains = Some(String::new());
    let outcome = envelope::envelope(&asked, &mut NoObserver).ok()?;
    Some(matches!(
        outcome.answer.finding,
        envelope::EnvelopeFinding::Inside { .. }
    ))
}

#[test]
fn deliveries_with_deadlines_at_half_their_times_are_repaired() {
    let Some(data) = shared::data() else { return };
    for instance in shared::instances::figure_4(&data).into_iter().step_by(4) {
        let task = shared::task(&instance.domain, &instance.problem).expect("a problem");
        let halved: Vec<Rational> = task
            .timed()
            .iter()
            .map(|own| &own.time * &Rational::new(1, 2))
            .collect();
        let task = Arc::new(task.with_numbers(&halved, []));
        let text = shared::source(&instance.plan).text().to_owned();
        let plan = any_plan(&task, &text).expect("a plan");
        let request = RepairRequest::new(&task, plan);
        let start = Instant::now();
        let outcome = repair(&request, &mut NoObserver).expect("within reach");
        let seconds = start.elapsed().as_secs_f64();
        verified(&outcome);
        match outcome.answer.finding {
            RepairFinding::Repaired {
                changes,
                cost,
                cases,
                not_guaranteed,
                ..
            } => {
                assert_eq!(not_guaranteed, None, "{}", instance.name);
                println!(
                    "{}: {} changes, cost {cost}, {cases} cases, {seconds:.3} s",
                    instance.name,
                    changes.len()
                );
            }
            RepairFinding::Impossible { because, .. } => {
                assert!(
                    because
                        .iter()
                        .any(|own| own.contains("nothing in the plan makes true")),
                    "{because:?}"
                );
            }
            other @ RepairFinding::None { .. } => panic!("{other:?}"),
        }
    }
}

#[test]
fn invalid_benchmark_plans_are_repaired_or_explained() {
    let Some(data) = shared::data() else { return };
    let (mut tried, mut repaired, mut unguaranteed, mut beyond, mut slowest) =
        (0, 0, 0, 0, (0.0, String::new()));
    let mut refused: BTreeMap<String, usize> = BTreeMap::new();
    let n: usize = shared::one_in(3);
    for files in benchmarks(&data).into_iter().step_by(n) {
        let name = files
            .plan
            .strip_prefix(&data)
            .expect("a file of the data")
            .display()
            .to_string();
        let Ok(task) = shared::task(&files.domain, &files.problem) else {
            continue;
        };
        let task = Arc::new(task);
        let text = shared::source(&files.plan).text().to_owned();
        let Some(plan) = any_plan(&task, &text) else {
            continue;
        };
        let request = RepairRequest::new(&task, plan);
        match works(&request) {
            Some(true) => continue,
            Some(false) => {}
            None => {
                beyond += 1;
                continue;
            }
        }
        tried += 1;
        let start = Instant::now();
        let outcome = repair(&request, &mut NoObserver);
        let seconds = start.elapsed().as_secs_f64();
        if seconds > slowest.0 {
            slowest = (seconds, name.clone());
        }
        let refusal = match outcome {
            Ok(outcome) => {
                verified(&outcome);
                match outcome.answer.finding {
                    RepairFinding::Repaired {
                        changes,
                        cost,
                        keeps,
                        not_guaranteed,
                        cases,
                        ..
                    } => {
                        repaired += 1;
                        unguaranteed += usize::from(not_guaranteed.is_some());
                        println!(
                            "{name}: {} changes, cost {}, {} bounds, {cases} cases, {seconds:.3} s {}",
                            changes.len(),
                            cost.to_decimal(6),
                            keeps.len(),
                            not_guaranteed.unwrap_or_default()
                        );
                        continue;
                    }
                    RepairFinding::Impossible { because, .. } => {
                        assert!(!because.is_empty(), "{name}: no reason");
                        because.join("; ")
                    }
                    RepairFinding::None { reason, .. } => format!("limit: {reason}"),
                }
            }
            Err(error) => error.to_string(),
        };
        println!("{name}: {refusal} ({seconds:.3} s)");
        *refused.entry(refusal).or_default() += 1;
    }
    let reasons = refused.len();
    let refused: usize = refused.values().sum();
    println!(
        "{tried} plans do not work: {repaired} repaired ({unguaranteed} of them without a guarantee), \
         {refused} not, for {reasons} reasons; {beyond} are beyond exact analysis; slowest {:.3} s, {}",
        slowest.0, slowest.1
    );
    assert_eq!(tried, repaired + refused);
    assert!(repaired * n >= 30, "{repaired}");
    assert_eq!(unguaranteed, 0);
}
