//! No plan is rejected in the situation for which it was made, and no plan is requested twice for the same situation.
//!
//! The tests cover all cases, random problems, and the benchmark plans if their folder is next to the repository: one plan of
//! each family, or as many as `ELBOWROOM_REQUEST_PLANS` says.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]
#![allow(dead_code, reason = "other tests use the rest")]

mod shared;
#[path = "../../../testing/solvable/mod.rs"]
#[allow(unused_imports, reason = "only the problems are drawn here")]
mod solvable;
#[path = "../examples/promise/sources.rs"]
mod sources;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Arc, Mutex};

use elbowroom::execute::{Embedded, Execution};
use elbowroom::execution::run::{PlanningTime, RunSettings};
use elbowroom::execution::{Decision, Entry, Recorder};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl;
use elbowroom::sim::{SimWorld, WorldModel};
use sources::Origin;

const EXECUTORS: [&str; 5] = ["guarded", "live", "esterel", "stn", "adaptable"];

/// Durations deviate by up to 30 %, and one start in ten fails.
const WORLD: &str = "format = \"elbowroom-world\"\nversion = 1
[[duration]]\naction = \"*\"\nuniform = { from = 0.7, to = 1.3 }\nrelative = true
[[failure]]\naction = \"*\"\nprobability = 0.1\n";

/// The requests of a run.
#[derive(Clone, Default)]
struct Requests(Arc<Mutex<Noted>>);

#[derive(Default)]
struct Noted {
    situations: BTreeSet<String>,
    count: usize,
    faults: Vec<String>,
    /// The beginning of the present plan, until something is observed.
    begins: Option<Rational>,
}

impl Recorder for Requests {
    fn record(&mut self, entry: &Entry<'_>) {
        let mut noted = self.0.lock().expect("no thread has panicked");
        match entry {
            Entry::Planning { now, situation, .. } => {
                noted.count += 1;
                if !noted.situations.insert(format!("{situation:?}")) {
                    noted.faults.push(format!("requested again at {now}"));
                }
            }
            Entry::Mission(mission) => noted.begins = Some(mission.origin.clone()),
            Entry::Taken { .. } => noted.begins = None,
            Entry::Decided { now, decided } if decided.decision == Decision::Replan => {
                let begins = noted.begins.take();
                if begins.is_some_and(|begins| **now <= begins + Rational::new(1, 1000)) {
                    let fault = format!("rejected at {now}: {}", decided.reason);
                    noted.faults.push(fault);
                }
            }
            _ => {}
        }
    }
}

/// Runs the plan with each executor, and returns the number of requests.
fn requests(label: &str, task: &Arc<Task>, plan: &TimeTriggeredPlan, seeds: u64) -> usize {
    let source = pddl::Source::new("world", WORLD);
    let model = WorldModel::read(source, task.problem()).expect("a correct test");
    let mut count = 0;
    for executor in EXECUTORS {
        for seed in 0..seeds {
            let requests = Requests::default();
            let mut world = SimWorld::new(Arc::clone(task), &model, seed);
            Execution::of(task)
                .beginning_with(plan.clone())
                .by(executor.parse().expect("an executor that there is"))
                .with_settings(RunSettings {
                    planning_time: PlanningTime::Seconds(Rational::ZERO),
                    ..RunSettings::default()
                })
                .planned_by(Embedded {
                    most_states: 200,
                    improve_states: 0,
                    ..Embedded::default()
                })
                .recorded_by(requests.clone())
                .run_in(&mut world);
            let noted = requests.0.lock().expect("no thread has panicked");
            assert_eq!(noted.faults, [""; 0], "{label}, {executor}, seed {seed}");
            count += noted.count;
        }
    }
    count
}

#[test]
fn plan_of_a_case_is_requested_once_and_not_rejected() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let mut count = 0;
    for entry in std::fs::read_dir(cases).expect("a folder") {
        let folder = entry.expect("a readable folder").path();
        let task = shared::task(&folder.join("domain.pddl"), &folder.join("problem.pddl"));
        let task = Arc::new(task.expect("a case"));
        // Runs do not support processes and events.
        if task.left_to_the_judge().is_some() {
            continue;
        }
        let plan = folder.join("plan.plan");
        if let Some(plan) = plan.is_file().then(|| shared::plan(&task, &plan)).flatten() {
            count += requests(&folder.display().to_string(), &task, &plan, 10);
        }
    }
    println!("{count} requests");
    assert!(count > 100, "{count}");
}

#[test]
fn plan_of_a_random_problem_is_requested_once_and_not_rejected() {
    let mut count = 0;
    // In the seeds after the first ones, numbers decide on conditional effects.
    for seed in (0..500).chain([1590]) {
        let problem = solvable::problem(seed).expect("a problem");
        let task = Arc::new(problem.task());
        if task.only_judged().is_some() || task.left_to_the_judge().is_some() {
            continue;
        }
        let source = pddl::Source::new("plan", problem.plan.as_str());
        let (plan, _) = pddl::read_plan(&source, &task).expect("a plan");
        count += requests(&format!("seed {seed}"), &task, &plan, 1);
    }
    println!("{count} requests");
    assert!(count > 100, "{count}");
}

#[test]
fn plan_of_a_benchmark_is_requested_once_and_not_rejected() {
    let Some(data) = shared::data() else {
        return;
    };
    let all = std::env::var("ELBOWROOM_REQUEST_PLANS").ok();
    let plans_of_a_family = all
        .as_ref()
        .map_or(1, |text| text.parse().expect("a number of plans"));
    let most_steps = if all.is_some() { 100 } else { 15 };
    let mut families: BTreeMap<String, usize> = BTreeMap::new();
    let mut count = 0;
    for source in sources::sources(&data) {
        let Origin::File(file) = &source.origin else {
            continue;
        };
        let Ok(task) = shared::task(&source.domain, &source.problem) else {
            continue;
        };
        let task = Arc::new(task);
        if task.left_to_the_judge().is_some() || task.only_judged().is_some() {
            continue;
        }
        let Some(plan) = shared::plan(&task, file).filter(|plan| plan.steps.len() <= most_steps)
        else {
            continue;
        };
        let family = families.entry(source.family.clone()).or_default();
        *family += 1;
        if *family > plans_of_a_family {
            continue;
        }
        let label = format!("{} {}", source.family, source.name);
        count += requests(&label, &task, &plan, 1);
        if all.is_some() {
            println!("{label}: {count} requests so far");
        }
    }
    println!("{count} requests in {} families", families.len());
    assert!(count > 20, "{count}");
}
