//! No plan is rejected in the situation for which it was made, no plan is requested twice for the
//! same situation, and the default executor does not begin a plan a third time with a guarantee
//! that durations have violated twice.
//!
//! The tests cover all cases, random problems, and the benchmark plans if their folder is next to
//! the repository: one plan of each family, or as many as `ELBOWROOM_REQUEST_PLANS` says.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]
#![allow(dead_code, reason = "other tests use the rest")]

use crate::shared;
use crate::solvable;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::promise::sources;
use crate::promise::sources::Origin;
use elbowroom::execute::{Embedded, Execution};
use elbowroom::execution::run::{PlanningTime, RunSettings};
use elbowroom::execution::{
    Cause, Decided, Decision, Entry, GuaranteeLevel, PreparedPlan, Recorder, Subject,
};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl;
use elbowroom::sim::{SimWorld, WorldModel};

const EXECUTORS: [&str; 5] = ["guarded", "live", "esterel", "stn", "adaptable"];

/// Durations deviate by up to 30 %, and one start in ten fails.
const WORLD: &str = "format = \"elbowroom-world\"\nversion = 1
[[duration]]\naction = \"*\"\nuniform = { from = 0.7, to = 1.3 }\nrelative = true
[[failure]]\naction = \"*\"\nprobability = 0.1\n";

/// All actions take less time than planned, by the same share. The same plans are made repeatedly.
const SHORT_WORLD: &str = "format = \"elbowroom-world\"\nversion = 1
[[duration]]\naction = \"*\"\nconstant = 0.8\nrelative = true\n";

/// Requests of a run.
#[derive(Clone, Default)]
struct Requests(Arc<Mutex<Noted>>);

#[derive(Default)]
struct Noted {
    situations: BTreeSet<String>,
    count: usize,
    faults: Vec<String>,
    /// Start of the current plan, until an event is observed.
    begins: Option<Rational>,
    /// Current plan, with times from its start.
    plan: TimeTriggeredPlan,
    /// Number of times in a row that this plan was abandoned for lack of time.
    abandoned: usize,
    is_lacking_time: bool,
    /// Number of plans that were started again after two failures, and the times of those with a
    /// guarantee.
    third_attempts: usize,
    third_with_guarantee: Vec<Rational>,
}

impl Noted {
    fn note_mission(&mut self, mission: &PreparedPlan) {
        if !self.is_lacking_time || self.plan != mission.time_triggered {
            self.abandoned = 0;
        }
        self.is_lacking_time = false;
        self.plan = mission.time_triggered.clone();
        self.begins = Some(mission.origin.clone());
    }

    fn note_decided(&mut self, now: &Rational, decided: &Decided) {
        let reason = &decided.reason;
        match decided.decision {
            Decision::Replan => {
                let begins = self.begins.take();
                if begins.is_some_and(|begins| *now <= begins + Rational::new(1, 1000)) {
                    self.faults.push(format!("rejected at {now}: {reason}"));
                }
                self.is_lacking_time = matches!(
                    reason.cause,
                    Cause::OutsideInterval | Cause::Outlived | Cause::Failed
                ) || matches!(reason.about, Some(Subject::InsufficientTime));
                self.abandoned += usize::from(self.is_lacking_time);
            }
            Decision::Start(_) if self.abandoned == 2 => {
                self.third_attempts += 1;
                if reason
                    .guarantee
                    .is_some_and(|promise| promise < GuaranteeLevel::Luck)
                {
                    self.third_with_guarantee.push(now.clone());
                }
            }
            _ => {}
        }
    }
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
            Entry::PlanAdopted(mission) => noted.note_mission(mission),
            Entry::Taken { .. } => noted.begins = None,
            Entry::Decided { now, decided } => noted.note_decided(now, decided),
            _ => {}
        }
    }
}

/// Runs the plan with each executor, and returns the number of requests.
fn requests(label: &str, task: &Arc<Task>, plan: &TimeTriggeredPlan, seeds: u64) -> usize {
    let mut count = 0;
    for executor in EXECUTORS {
        for seed in 0..seeds {
            count += run(label, task, plan, executor, WORLD, seed).count;
        }
        count += run(label, task, plan, executor, SHORT_WORLD, 0).count;
    }
    count
}

/// Runs the plan once, and returns the notes about its requests, after checking them.
fn run(
    label: &str,
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    executor: &str,
    world: &str,
    seed: u64,
) -> Noted {
    let source = pddl::Source::new("world", world);
    let model = WorldModel::read(source, task.problem()).expect("a correct test");
    let requests = Requests::default();
    let mut simulated = SimWorld::new(Arc::clone(task), &model, seed);
    Execution::of(task)
        .beginning_with(plan.clone())
        .by(executor.parse().expect("an executor that there is"))
        .with_settings(RunSettings {
            planning_time: PlanningTime::Seconds(Rational::ZERO),
            ..RunSettings::default()
        })
        .with_planner(Embedded {
            most_states: 200,
            improve_states: 0,
            ..Embedded::default()
        })
        .recorded_by(requests.clone())
        .run_in(&mut simulated);
    let is_short = world == SHORT_WORLD;
    let noted = std::mem::take(&mut *requests.0.lock().expect("no thread has panicked"));
    assert_eq!(noted.faults, [""; 0], "{label}, {executor}, seed {seed}");
    // In this world, only durations can cause failures. The other executors repeat a plan with its
    // guarantee.
    if is_short && executor == "live" {
        assert_eq!(noted.third_with_guarantee, [], "{label}");
    }
    noted
}

/// Returns a task with three actions: the first one ends during the second, and the second during
/// the third.
fn nested(least: [i64; 3]) -> Arc<Task> {
    let [a, b, c] = least;
    let domain = format!(
        "(define (domain nested) (:requirements :durative-actions :duration-inequalities)
        (:predicates (first) (second) (third) (first-done) (second-done) (third-done))
        (:durative-action a :parameters ()
          :duration (and (>= ?duration {a}) (<= ?duration {}))
          :condition (at end (second))
          :effect (and (at start (first)) (at end (not (first))) (at end (first-done))))
        (:durative-action b :parameters ()
          :duration (and (>= ?duration {b}) (<= ?duration {}))
          :condition (and (at start (first)) (at end (third)))
          :effect (and (at start (second)) (at end (not (second))) (at end (second-done))))
        (:durative-action c :parameters ()
          :duration (and (>= ?duration {c}) (<= ?duration {}))
          :condition (at start (second))
          :effect (and (at start (third)) (at end (not (third))) (at end (third-done)))))",
        4 * a,
        2 * b + 1,
        20 * c,
    );
    let problem = "(define (problem p) (:domain nested) (:init)
        (:goal (and (first-done) (second-done) (third-done))))";
    let domain = pddl::Source::new("domain", domain);
    let problem = pddl::Source::new("problem", problem);
    let problem = pddl::read_problem(&domain, &problem).expect("a correct test");
    Arc::new(Task::new(problem.0))
}

#[test]
fn plan_broken_twice_by_short_durations_starts_without_guarantee() {
    let mut count = 0;
    for least in [[3, 4, 2], [3, 5, 2], [2, 3, 1], [4, 5, 2], [5, 6, 4]] {
        let task = nested(least);
        let [a, b, _] = least.map(Rational::from);
        let text = format!(
            "0: (a) [{a}]\n{}: (b) [{b}]\n{}: (c) [{b}]",
            &a - Rational::new(1, 500),
            &a + Rational::new(1, 1000)
        );
        let source = pddl::Source::new("plan", text);
        let (plan, _) = pddl::read_plan(&source, &task).expect("a plan");
        for world in [WORLD, SHORT_WORLD] {
            let noted = run(&format!("{least:?}"), &task, &plan, "live", world, 0);
            count += noted.third_attempts;
        }
    }
    println!("{count} third attempts");
    assert!(count > 1, "{count}");
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
        if task.unsupported_by_analysis().is_some() {
            continue;
        }
        let plan = folder.join("plan.plan");
        if let Some(plan) = plan.is_file().then(|| shared::plan(&task, &plan)).flatten() {
            count += requests(&folder.display().to_string(), &task, &plan, 10);
        }
    }
    println!("{count} requests");
    assert!(count > 50, "{count}");
}

#[test]
fn plan_of_a_random_problem_is_requested_once_and_not_rejected() {
    let mut count = 0;
    // In the seeds after the first ones, conditional effects depend on numbers.
    for seed in (0..500 / shared::one_in::<u64>(2)).chain([1590]) {
        let problem = solvable::problem(seed).expect("a problem");
        let task = Arc::new(problem.task());
        if task.validator_only_feature().is_some() || task.unsupported_by_analysis().is_some() {
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
        if task.unsupported_by_analysis().is_some() || task.validator_only_feature().is_some() {
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
