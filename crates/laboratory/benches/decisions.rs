//! How long the decisions of `policy` take, in the worlds of `experiments`: making the table, then
//! median, 99th percentile and worst of all decisions of 200 runs, those with which a run begins
//! included. `live` beside it has no table. The optimum's bounds are those of the table's grid.
//!
//! ```text
//! cargo bench -p elbowroom-laboratory --bench decisions
//! ```

#![allow(clippy::print_stdout, reason = "the table is what it is for")]
#![allow(clippy::disallowed_methods, reason = "decisions are timed")]

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use elbowroom::execute::{Embedded, Execution, WholeRegion};
use elbowroom_execution::executors::{ExecutorSpec, Foresight, Means};
use elbowroom_execution::run::Verdict;
use elbowroom_execution::{
    Decided, Executor, Mission, Moment, Need, Outlook, PlanAnswer, Planned, Planner, Reason, StepId,
};
use elbowroom_laboratory::timed::{Policy, Settings};
use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_probability::Likelihoods;
use elbowroom_sim::WorldModel;

const RUNS: u64 = 200;

fn main() {
    // As the harness of tests does: only those whose name contains the words are run.
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
}

fn rows(name: &str) {
    let file = |file: &str| {
        let folder = env!("CARGO_MANIFEST_DIR");
        std::fs::read_to_string(format!("{folder}/../../experiments/{name}/{file}"))
            .expect("a file of the experiment")
    };
    let source = |name: &str| Source::new(name, file(name));
    let read = read_problem(&source("domain.pddl"), &source("problem.pddl"));
    let task = Arc::new(Task::new(read.expect("it is PDDL").0));
    let world = WorldModel::read(&file("world.toml"), task.problem()).expect("a world");
    let begin = Instant::now();
    let policy = Policy::new(&task, &world, &Settings::default(), &|| true);
    let policy = policy.expect("all of it is known to the process");
    let made = begin.elapsed();
    let policy = policy.expect("a grid was finished");
    let optimum = policy.optimum();
    let (lower, upper) = (optimum.lower, optimum.upper);
    let policy: Arc<dyn Outlook> = Arc::new(policy);
    let beginning = Situation::initial(&task);
    let PlanAnswer::Plan(plan) = Embedded::default().plan(&task, &beginning).answer else {
        panic!("{name} has a plan");
    };
    for executor in ["policy", "live"] {
        let times = Arc::new(Mutex::new(Vec::new()));
        let mut reached = 0;
        for seed in 0..RUNS {
            let spec: ExecutorSpec = executor.parse().expect("a known executor");
            let clocked = Timed {
                inner: spec.build(Means {
                    region: Box::new(WholeRegion),
                    likelihoods: Arc::new(Likelihoods::certain()),
                    odds: None,
                    foresight: Foresight::default(),
                    outlook: spec.asks_outlook().then(|| Arc::clone(&policy)),
                    rehearsal: None,
                }),
                times: Arc::clone(&times),
            };
            let execution = Execution::of(&task).decided_by(clocked);
            let execution = execution.beginning_with(plan.clone());
            let report = execution.run_in(&mut *world.world(&task, seed));
            reached += u64::from(report.verdict == Verdict::GoalReached);
        }
        let mut times = std::mem::take(&mut *times.lock().expect("no thread has panicked"));
        times.sort_unstable();
        let at = |share: usize| milliseconds(times[(times.len() - 1) * share / 100]);
        let (median, p99, worst) = (at(50), at(99), at(100));
        let table = match executor {
            "policy" => milliseconds(made),
            _ => String::new(),
        };
        let decisions = times.len();
        println!(
            "| `{name}` | `{executor}` | {table} | {median} | {p99} | {worst} | {decisions} | {reached} of {RUNS} | {lower:.4} to {upper:.4} |"
        );
    }
}

fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1000.0)
}

/// An executor whose decisions are timed.
struct Timed {
    inner: Box<dyn Executor>,
    times: Arc<Mutex<Vec<Duration>>>,
}

impl Executor for Timed {
    fn need(&self) -> Need {
        self.inner.need()
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        self.inner.adopt(mission)
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let begin = Instant::now();
        let decided = self.inner.decide(moment);
        let took = begin.elapsed();
        self.times
            .lock()
            .expect("no thread has panicked")
            .push(took);
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.inner.window(step, is_end)
    }
}
