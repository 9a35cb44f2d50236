//! Decision times of `policy` in the worlds of `experiments`: the time for its table, then the
//! median, 99th percentile and maximum over all decisions of 200 runs, the first ones included. For
//! comparison, `live` has no table. The optimum's bounds are those of the table's grid. With the
//! argument `rehearsed`, the benchmark measures `policy` without a table in 20 runs.
//!
//! ```text
//! cargo bench -p elbowroom-laboratory --bench decisions
//! ```

#![allow(clippy::print_stdout, reason = "the table is what it is for")]
#![allow(clippy::disallowed_methods, reason = "decisions are timed")]

mod timed;

use std::sync::Arc;
use std::time::Instant;

use elbowroom::execute::{
    Embedded, ExactRegion, Execution, Replanning, RolloutPolicy, Rollouts, SharedRolloutPolicy,
};
use elbowroom::mdp::{Policy, Settings};
use elbowroom::pipeline;
use elbowroom_execution::executors::{ExecutorServices, ExecutorSpec, PolicyTableCache};
use elbowroom_execution::run::{RunSettings, Verdict};
use elbowroom_execution::{ActionValues, PlanAnswer, Planner};
use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_probability::Likelihoods;
use elbowroom_sim::WorldModel;
use timed::{Timed, Times, milliseconds};

const RUNS: u64 = 200;

/// Number of runs of `policy` without a table.
const ROLLOUT_RUNS: u64 = 20;

fn main() {
    // Like the test harness, it runs only the cases whose name contains the words.
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<_> = words.iter().filter(|word| !word.starts_with('-')).collect();
    println!(
        "| world | executor | table | median | p99 | worst | decisions | goal reached | optimum |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|---:|---:|");
    for world in [
        "weld",
        "rendezvous",
        "door",
        "machines",
        "detour",
        "counter",
    ] {
        if words.is_empty() || words.iter().any(|word| world.contains(word.as_str())) {
            rows(world);
        }
    }
    if words.is_empty() || words.iter().any(|word| *word == "rehearsed") {
        let delivery = "../cases/delivery";
        for (name, folder, world) in [
            ("weld", "weld", "weld/world.toml"),
            ("rendezvous", "rendezvous", "rendezvous/world.toml"),
            ("door", "door", "door/world.toml"),
            ("clumsy", delivery, "clumsy/door.toml"),
        ] {
            bench_rollouts(name, folder, world);
        }
    }
}

fn file(path: &str) -> String {
    let folder = env!("CARGO_MANIFEST_DIR");
    std::fs::read_to_string(format!("{folder}/../../experiments/{path}")).expect("a file")
}

fn read(folder: &str, world: &str) -> (Arc<Task>, WorldModel) {
    let source = |name: &str| Source::new(name, file(&format!("{folder}/{name}")).as_str());
    let read = read_problem(&source("domain.pddl"), &source("problem.pddl"));
    let task = Arc::new(Task::new(read.expect("it is PDDL").0));
    let world = WorldModel::read(file(world).as_str(), task.problem()).expect("a world");
    (task, world)
}

/// Measures `policy` without a table.
fn bench_rollouts(name: &str, folder: &str, world: &str) {
    let (task, world) = read(folder, world);
    let beginning = Situation::initial(&task);
    let PlanAnswer::Plan(plan) = Embedded::default().plan(&task, &beginning).answer else {
        panic!("{name} has a plan");
    };
    let (times, mut reached) = (Times::default(), 0);
    for seed in 0..ROLLOUT_RUNS {
        let embedded = Embedded::default();
        let rollouts = Rollouts {
            world: Arc::new(world.clone()),
            executor: ExecutorSpec::default(),
            settings: RunSettings::default(),
            flow: pipeline::Settings::default(),
            likelihoods: Arc::new(Likelihoods::certain()),
            replanning: Some(Replanning::within(&embedded)),
            is_ready: true,
        };
        let rehearse = SharedRolloutPolicy::new(RolloutPolicy::new(rollouts, embedded));
        let spec: ExecutorSpec = "policy".parse().expect("a known executor");
        let clocked = Timed {
            inner: spec.build(ExecutorServices {
                rollout: Some(Box::new(rehearse.clone())),
                ..ExecutorServices::from(Box::new(ExactRegion))
            }),
            times: times.clone(),
        };
        let execution = Execution::of(&task).with_executor(clocked);
        let execution = execution.beginning_with(plan.clone());
        let execution = execution.with_rollouts(Some(rehearse));
        let report = execution.run_in(&mut *world.world(&task, seed));
        reached += u64::from(report.verdict == Verdict::GoalReached);
    }
    let (decisions, [median, p99, worst]) = times.summary();
    println!(
        "| `{name}` | `policy` | none | {median} | {p99} | {worst} | {decisions} | {reached} of {ROLLOUT_RUNS} | |"
    );
}

fn rows(name: &str) {
    let (task, world) = read(name, &format!("{name}/world.toml"));
    let begin = Instant::now();
    let policy = Policy::new(&task, &world, &Settings::default(), &|| true);
    let policy = policy.expect("all of it is known to the process");
    let made = begin.elapsed();
    let policy = policy.expect("a grid was finished");
    let optimum = policy.optimum();
    let (lower, upper) = (optimum.lower, optimum.upper);
    let policy: Arc<dyn ActionValues> = Arc::new(policy);
    let beginning = Situation::initial(&task);
    let PlanAnswer::Plan(plan) = Embedded::default().plan(&task, &beginning).answer else {
        panic!("{name} has a plan");
    };
    for executor in ["policy", "live"] {
        let times = Times::default();
        let mut reached = 0;
        for seed in 0..RUNS {
            let spec: ExecutorSpec = executor.parse().expect("a known executor");
            let clocked = Timed {
                inner: spec.build(ExecutorServices {
                    region: Box::new(ExactRegion),
                    likelihoods: Arc::new(Likelihoods::certain()),
                    comparator: None,
                    policy_cache: PolicyTableCache::default(),
                    order_cache: None,
                    action_values: spec.needs().action_values.then(|| Arc::clone(&policy)),
                    rollout: None,
                    has_planner: false,
                }),
                times: times.clone(),
            };
            let execution = Execution::of(&task).with_executor(clocked);
            let execution = execution.beginning_with(plan.clone());
            let report = execution.run_in(&mut *world.world(&task, seed));
            reached += u64::from(report.verdict == Verdict::GoalReached);
        }
        let (decisions, [median, p99, worst]) = times.summary();
        let table = match executor {
            "policy" => milliseconds(made),
            _ => String::new(),
        };
        println!(
            "| `{name}` | `{executor}` | {table} | {median} | {p99} | {worst} | {decisions} | {reached} of {RUNS} | {lower:.4} to {upper:.4} |"
        );
    }
}
