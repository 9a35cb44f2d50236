//! A run starts under exactly the envelope that is reported for its plan: every end of every
//! interval, with the same settings.
//!
//! The tests cover all cases, and the benchmark plans if their folder is next to the repository.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]
#![allow(dead_code, reason = "other tests use the rest")]

use crate::shared;
use crate::solvable;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::promise::sources;
use crate::promise::sources::Origin;
use elbowroom::answers::envelope::Search;
use elbowroom::answers::{EnvelopeRequest, NoObserver, envelope};
use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::execute::Execution;
use elbowroom::execution::run::{PlanningTime, RunSettings, TimeoutRule};
use elbowroom::execution::{Entry, NoPlanner, Recorder};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl;
use elbowroom::pipeline;
use elbowroom::plan::DecoupledEnvelope;
use elbowroom::sim::{SimWorld, WorldModel};

/// Recorder of the envelope of the first plan of a run.
#[derive(Clone, Default)]
struct First(Arc<Mutex<Option<DecoupledEnvelope>>>);

impl Recorder for First {
    fn record(&mut self, entry: &Entry<'_>) {
        if let Entry::PlanAdopted(mission) = entry {
            let mut first = self.0.lock().expect("nobody has panicked");
            if first.is_none() {
                first.clone_from(&mission.envelope);
            }
        }
    }
}

/// Returns the envelope under which a run of the plan starts.
fn of_run(
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    settings: &pipeline::Settings,
) -> Option<DecoupledEnvelope> {
    let model = WorldModel::without_deviations();
    let mut world = SimWorld::new(Arc::clone(task), &model, 0);
    let first = First::default();
    Execution::of(task)
        .beginning_with(plan.clone())
        .by("guarded".parse().expect("an executor that there is"))
        .with_settings(RunSettings {
            planning_time: PlanningTime::Seconds(Rational::ZERO),
            timeout: settings.timeout.clone(),
            ..RunSettings::default()
        })
        .with_envelopes(settings.clone())
        .with_planner(NoPlanner)
        .recorded_by(first.clone())
        .run_in(&mut world);
    first.0.lock().expect("nobody has panicked").take()
}

/// Returns the reported envelope.
fn reported(
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    settings: &pipeline::Settings,
) -> Option<DecoupledEnvelope> {
    let request = EnvelopeRequest::new(task, plan.clone()).with_settings(settings);
    let outcome = envelope::envelope(&request, &mut NoObserver).ok()?;
    outcome.envelope
}

/// Returns `true` if there is an envelope; panics if the two differ.
fn assert_one(
    label: &str,
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    settings: &pipeline::Settings,
) -> bool {
    let reported = reported(task, plan, settings);
    let of_run = of_run(task, plan, settings);
    assert_eq!(
        reported, of_run,
        "{label}: reported, and the one of the run"
    );
    reported.is_some()
}

fn read(domain: &Path, problem: &Path, epsilon: Option<Rational>) -> Option<Arc<Task>> {
    let task = shared::task(domain, problem).ok()?;
    let task = match epsilon {
        Some(epsilon) => task.with_epsilon(epsilon),
        None => task,
    };
    Some(Arc::new(task))
}

/// Returns the folders with a domain, a problem and a plan.
fn folders(within: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(within).expect("a folder");
    let mut folders: Vec<PathBuf> = entries
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|folder| folder.join("plan.plan").is_file())
        .collect();
    folders.sort();
    folders
}

fn settings() -> Vec<(&'static str, pipeline::Settings)> {
    let usual = pipeline::Settings::default();
    let with = |guarantee, search| pipeline::Settings {
        guarantee,
        search,
        ..usual.clone()
    };
    vec![
        ("dynamic", usual.clone()),
        ("weak", with(Guarantee::Weak, Search::default())),
        ("strong", with(Guarantee::Strong, Search::default())),
        ("IRR", with(Guarantee::Dynamic, Search::irr())),
        (
            "widths",
            with(Guarantee::Dynamic, Search::best(Objective::Widths)),
        ),
        (
            "without time-outs",
            pipeline::Settings {
                timeout: TimeoutRule::Off,
                ..usual.clone()
            },
        ),
        (
            "within a time-out that is too short",
            pipeline::Settings {
                timeout: "0.5".parse().expect("a time-out"),
                ..usual.clone()
            },
        ),
        (
            "after 7 checks",
            pipeline::Settings {
                search: Search {
                    most_checks: Some(7),
                    ..usual.search.clone()
                },
                ..usual
            },
        ),
    ]
}

#[test]
fn run_of_each_case_starts_under_its_reported_envelope() {
    let mut count = 0;
    for folder in folders(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases")) {
        let file = |name: &str| folder.join(name);
        for epsilon in [None, Some(Rational::new(1, 100))] {
            let (domain, problem) = (file("domain.pddl"), file("problem.pddl"));
            let task = read(&domain, &problem, epsilon).expect("a case");
            let Some(plan) = shared::plan(&task, &file("plan.plan")) else {
                continue;
            };
            for (name, settings) in settings() {
                let label = format!("{}, {name}, {}", folder.display(), task.epsilon());
                // Runs do not support processes and events.
                if task.unsupported_by_analysis().is_none() {
                    count += usize::from(assert_one(&label, &task, &plan, &settings));
                }
            }
        }
    }
    println!("{count} envelopes");
    assert!(count > 50, "{count}");
}

#[test]
fn run_of_a_random_plan_starts_under_its_reported_envelope() {
    let mut count = 0;
    for seed in 0..400 {
        let problem = solvable::problem(seed).expect("a problem");
        let task = Arc::new(problem.task());
        if task.validator_only_feature().is_some() || task.unsupported_by_analysis().is_some() {
            continue;
        }
        let source = pddl::Source::new("plan", problem.plan.as_str());
        let (plan, _) = pddl::read_plan(&source, &task).expect("a plan");
        for (name, settings) in settings().into_iter().take(2) {
            let label = format!("seed {seed}, {name}");
            count += usize::from(assert_one(&label, &task, &plan, &settings));
        }
    }
    println!("{count} envelopes");
    assert!(count > 200, "{count}");
}

#[test]
fn run_of_each_benchmark_plan_starts_under_its_reported_envelope() {
    let Some(data) = shared::data() else {
        return;
    };
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut plans: Vec<(String, [PathBuf; 3])> = Vec::new();
    for source in sources::sources(&data) {
        let Origin::File(file) = &source.origin else {
            continue;
        };
        let count = counts.entry(source.family.clone()).or_default();
        *count += 1;
        if *count <= 2 {
            let label = format!("{} {}", source.family, source.name);
            plans.push((label, [source.domain, source.problem, file.clone()]));
        }
    }
    for folder in ["bug-reports", "false-answers"] {
        let folder = data.join(folder);
        for folder in if folder.is_dir() {
            folders(&folder)
        } else {
            Vec::new()
        } {
            let pairs = [["domain.pddl", "problem.pddl"], ["d.pddl", "p.pddl"]];
            let paths = pairs.map(|both| both.map(|name| folder.join(name)));
            let found = paths.into_iter().find(|both| both[0].is_file());
            if let Some([domain, problem]) = found {
                let plan = folder.join("plan.plan");
                plans.push((folder.display().to_string(), [domain, problem, plan]));
            }
        }
    }
    let mut count = 0;
    for (label, [domain, problem, file]) in plans {
        let Some(task) = read(&domain, &problem, None) else {
            continue;
        };
        if task.unsupported_by_analysis().is_some() {
            continue;
        }
        let Some(plan) = shared::plan(&task, &file).filter(|plan| plan.steps.len() <= 25) else {
            continue;
        };
        let usual = pipeline::Settings::default();
        count += usize::from(assert_one(&label, &task, &plan, &usual));
    }
    println!("{count} envelopes");
    assert!(count > 15, "{count}");
}
