//! Time from a parsed plan to its box, on the instances of the paper's Figures 3 and 4.
//!
//! `whole` compiles the obligations and searches with the authors' settings (β = 1, doubling).
//! `first_widening` stops when the box has grown for the first time. Both need the benchmark files
//! next to the repository.
//!
//! They use the weak guarantee, as the paper does. The group `dynamic` runs the same searches with
//! the dynamic guarantee.
//!
//! `rounds` and `rounds_first_widening` are deliveries of our own with all durations as parameters,
//! by the number of parameters. `many` is the complete answer of `elbowroom envelope`, with the
//! limits of each end, for plans with up to a thousand parameters.

#[path = "../tests/elbowroom/shared/mod.rs"]
mod shared;

use std::ops::ControlFlow;
use std::sync::Arc;

use divan::Bencher;
use elbowroom::answers::envelope::envelope;
use elbowroom::answers::{EnvelopeRequest, NoObserver};
use elbowroom::{AnyPlan, pipeline};
use elbowroom_envelope::{Guarantee, Oracle, Settings, irr};
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::{ParametrizedPlan, format};
use shared::chains::{Needs, chains};
use shared::instances::{Instance, figure_3, figure_4};

fn main() {
    divan::main();
}

/// Returns all instances of both figures.
fn instances() -> Vec<Instance> {
    let Some(data) = shared::data() else {
        return Vec::new();
    };
    [figure_3(&data), figure_4(&data)].concat()
}

fn names() -> Vec<String> {
    instances()
        .into_iter()
        .map(|instance| instance.name)
        .collect()
}

fn read(name: &str) -> (Arc<Task>, Arc<ParametrizedPlan>) {
    let instance = instances()
        .into_iter()
        .find(|i| i.name == name)
        .expect("a known instance");
    let task = shared::task(&instance.domain, &instance.problem).expect("a readable problem");
    let bytes = std::fs::read(&instance.plan).expect("a plan file");
    let plan = format::read(&bytes, &task).expect("a readable plan");
    (Arc::new(task), Arc::new(plan))
}

/// Searches until there are `enough` widenings.
fn search(
    task: &Arc<Task>,
    plan: &Arc<ParametrizedPlan>,
    guarantee: Guarantee,
    enough: usize,
) -> usize {
    let mut oracle = Oracle::new(task, plan, guarantee).expect("within reach");
    let mut widenings = 0;
    let run = irr(&mut oracle, &Settings::default(), &mut |widening| {
        widenings += usize::from(widening.is_some());
        if widenings >= enough {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    run.expect("within reach").checks
}

#[divan::bench(args = names(), sample_count = 20)]
fn whole(bencher: Bencher<'_, '_>, name: &str) {
    let (task, plan) = read(name);
    bencher.bench_local(|| search(&task, &plan, Guarantee::Weak, usize::MAX));
}

#[divan::bench(args = names(), sample_count = 20)]
fn first_widening(bencher: Bencher<'_, '_>, name: &str) {
    let (task, plan) = read(name);
    bencher.bench_local(|| search(&task, &plan, Guarantee::Weak, 1));
}

/// Returns a delivery with this number of durations as parameters.
fn delivery(parameters: usize) -> (Arc<Task>, Arc<ParametrizedPlan>) {
    let (problem, plan) = shared::rounds::rounds(parameters / 4);
    let domain = Source::new("domain", shared::rounds::DOMAIN);
    let (problem, _) =
        read_problem(&domain, &Source::new("problem", problem)).expect("a readable problem");
    let task = Task::new(problem);
    let (plan, _) = read_plan(&Source::new("plan", plan), &task).expect("a readable plan");
    let freed = pipeline::free(&task, &plan).expect("a valid plan");
    let plan = pipeline::open(&task, freed, &[]).expect("durations to leave open");
    assert_eq!(plan.parameters.len(), parameters);
    (Arc::new(task), Arc::new(plan))
}

#[divan::bench(args = [33, 65], sample_count = 20)]
fn rounds(bencher: Bencher<'_, '_>, parameters: usize) {
    let (task, plan) = delivery(parameters);
    bencher.bench_local(|| search(&task, &plan, Guarantee::Weak, usize::MAX));
}

#[divan::bench(args = [33, 65], sample_count = 20)]
fn rounds_first_widening(bencher: Bencher<'_, '_>, parameters: usize) {
    let (task, plan) = delivery(parameters);
    bencher.bench_local(|| search(&task, &plan, Guarantee::Weak, 1));
}

/// Numbers of robots and of ways of each robot, and their needs.
const MANY: [(usize, usize, Needs); 6] = [
    (1, 100, Needs::Time),
    (1, 400, Needs::Time),
    (1, 1000, Needs::Time),
    (10, 100, Needs::Time),
    (1, 100, Needs::Charge),
    (1, 400, Needs::Charge),
];

#[divan::bench(args = MANY, sample_count = 3)]
fn many(bencher: Bencher<'_, '_>, (robots, ways, needs): (usize, usize, Needs)) {
    let (domain, problem, plan) = chains(robots, ways, needs);
    let domain = Source::new("domain", domain);
    let problem = Source::new("problem", problem);
    let (problem, _) = read_problem(&domain, &problem).expect("a readable problem");
    let task = Task::new(problem);
    let (plan, _) = read_plan(&Source::new("plan", plan), &task).expect("a readable plan");
    let request = EnvelopeRequest::new(&Arc::new(task), AnyPlan::TimeTriggered(plan));
    bencher.bench_local(|| envelope(&request, &mut NoObserver).expect("within exact reasoning"));
}

#[divan::bench_group]
mod dynamic {
    use divan::Bencher;
    use elbowroom_envelope::Guarantee;

    #[divan::bench(args = super::names(), sample_count = 20)]
    fn whole(bencher: Bencher<'_, '_>, name: &str) {
        let (task, plan) = super::read(name);
        bencher.bench_local(|| super::search(&task, &plan, Guarantee::Dynamic, usize::MAX));
    }

    #[divan::bench(args = super::names(), sample_count = 20)]
    fn first_widening(bencher: Bencher<'_, '_>, name: &str) {
        let (task, plan) = super::read(name);
        bencher.bench_local(|| super::search(&task, &plan, Guarantee::Dynamic, 1));
    }

    #[divan::bench(args = [33, 65], sample_count = 20)]
    fn rounds(bencher: Bencher<'_, '_>, parameters: usize) {
        let (task, plan) = super::delivery(parameters);
        bencher.bench_local(|| super::search(&task, &plan, Guarantee::Dynamic, usize::MAX));
    }
}
