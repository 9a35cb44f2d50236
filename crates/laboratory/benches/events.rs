//! Decision times of `guarded` and `live` for a plan from files: median, 99th percentile and
//! maximum over all decisions of one run. The preparation of plans is not included.
//!
//! ```text
//! cargo bench -p elbowroom-laboratory --bench events -- DOMAIN PROBLEM PLAN [WORLD] [EXECUTOR…]
//! ```
//!
//! Without a world, nothing deviates. `python3 testing/large_plans.py - --files FOLDER --shape NAME
//! POINTS` writes a plan for a measurement, with a world in which durations deviate. Paths are
//! absolute or relative to the crate's folder.

#![allow(clippy::print_stdout, reason = "the table is what it is for")]
#![allow(clippy::disallowed_methods, reason = "decisions are timed")]

mod timed;

use std::path::Path;
use std::sync::Arc;

use elbowroom::execute::{ExactRegion, Execution};
use elbowroom_execution::executors::{ExecutorServices, ExecutorSpec};
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_sim::{SimWorld, WorldModel};
use timed::{Timed, Times};

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
    let known = ["guarded", "live"];
    if let Some(word) = executors
        .iter()
        .find(|word| !known.contains(&word.as_str()))
    {
        println!("`{word}` is neither a file nor an executor that is measured: guarded, live");
        return;
    }
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
    for executor in known {
        if !executors.is_empty() && !executors.iter().any(|word| *word == executor) {
            continue;
        }
        let spec: ExecutorSpec = executor.parse().expect("a known executor");
        let times = Times::default();
        let decider = Timed {
            inner: spec.build(ExecutorServices::from(Box::new(ExactRegion))),
            times: times.clone(),
        };
        let execution = Execution::of(&task).beginning_with(plan.clone()).by(spec);
        let mut world = SimWorld::new(Arc::clone(&task), &model, 1);
        let report = execution.with_executor(decider).run_in(&mut world);
        let (count, [median, p99, worst]) = times.summary();
        let verdict = report.verdict;
        println!("| `{executor}` | {count} | {median} | {p99} | {worst} | {verdict:?} |");
    }
}
