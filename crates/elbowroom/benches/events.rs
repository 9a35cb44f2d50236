//! How long the decisions of `guarded` and `live` take on plans from files: median, 99th percentile and worst of the
//! decisions that follow when an action ends, in worlds of the shape given, with the making ready of new plans left out.
//!
//! ```text
//! cargo bench -p elbowroom --bench events -- DOMAIN PROBLEM PLAN [WORLD] [EXECUTOR…]
//! ```
//!
//! Without a world, nothing deviates. `python3 testing/large_plans.py --files FOLDER --shape NAME POINTS` writes plans to
//! measure, with a world in which durations deviate.

#![allow(clippy::print_stdout, reason = "the table is what it is for")]
#![allow(clippy::disallowed_methods, reason = "decisions are timed")]

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use elbowroom::execute::{Execution, WholeRegion};
use elbowroom::execution::executors::{ExecutorSpec, Means};
use elbowroom::execution::{
    Decided, Executor, Mission, Moment, Need, News, Planned, Reason, StepId,
};
use elbowroom::model::Task;
use elbowroom::pddl::{Source, read_plan, read_problem};
use elbowroom::sim::{SimWorld, WorldModel};

/// No more decisions are looked at.
const MOST: usize = 20_000;

fn main() {
    let words = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'));
    let words: Vec<String> = words.collect();
    let [domain, problem, plan, rest @ ..] = words.as_slice() else {
        println!("no plan to measure: give a domain, a problem and a plan");
        return;
    };
    let (files, executors): (Vec<_>, Vec<_>) = rest
        .iter()
        .partition(|word| Path::new(word.as_str()).is_file());
    let source = |path: &String| {
        let text = std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{path}: {why}"));
        Source::new(path, text)
    };
    let (problem, _) = read_problem(&source(domain), &source(problem)).expect("a problem");
    let task = Arc::new(Task::new(problem));
    let (plan, _) = read_plan(&source(plan), &task).expect("a plan");
    let text = files.first().map_or_else(
        || "format = \"elbowroom-world\"\nversion = 1\n".to_owned(),
        |path| std::fs::read_to_string(path).expect("a readable world"),
    );
    let model = WorldModel::read(&text, task.problem()).expect("a world");
    println!("| executor | decisions | median | p99 | worst | ended |");
    println!("|---|---:|---:|---:|---:|---|");
    for executor in ["guarded", "live"] {
        if !executors.is_empty() && !executors.iter().any(|word| *word == executor) {
            continue;
        }
        let spec: ExecutorSpec = executor.parse().expect("a known executor");
        let times = Arc::new(Mutex::new(Vec::new()));
        let decider = Timed {
            inner: spec.build(Means::from(Box::new(WholeRegion))),
            times: Arc::clone(&times),
        };
        let execution = Execution::of(&task).beginning_with(plan.clone()).by(spec);
        let mut world = SimWorld::new(Arc::clone(&task), &model, 1);
        let report = execution.decided_by(decider).run_in(&mut world);
        let mut times = times.lock().expect("nobody panics").clone();
        times.sort_unstable();
        let at = |share: usize| {
            let index = times.len().saturating_sub(1) * share / 100;
            times
                .get(index)
                .map_or(0.0, |time| time.as_secs_f64() * 1000.0)
        };
        let (median, p99, worst) = (at(50), at(99), at(100));
        let (count, verdict) = (times.len(), report.verdict);
        println!(
            "| `{executor}` | {count} | {median:.4} ms | {p99:.4} ms | {worst:.4} ms | {verdict:?} |"
        );
    }
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
        let time = begin.elapsed();
        let mut times = self.times.lock().expect("nobody panics");
        let is_end = |news: &News| matches!(news, News::Ended { .. });
        if times.len() < MOST && moment.news.iter().any(is_end) {
            times.push(time);
        }
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.inner.window(step, is_end)
    }
}
