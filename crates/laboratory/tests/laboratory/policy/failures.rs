//! Executors in small random worlds whose failures are undone or have outcomes, in comparison with
//! each other and with the value of the table of `lookahead`.
//!
//! `ELBOWROOM_WORLDS=1000` sets the number of seeds, and the figures are printed (`--nocapture`).

use std::sync::Arc;

use elbowroom::execute::{Embedded, Execution};
use elbowroom_execution::run::{Report, Verdict};
use elbowroom_execution::{PlanAnswer, Planner};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_probability::optimum::PolicyTable;
use elbowroom_probability::{Likelihoods, SearchState, likelihoods};
use elbowroom_sim::WorldModel;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::twin::SmallWorld;

const RUNS: u64 = 100;

/// Executors that use likelihoods, followed by those that do not.
const EXECUTORS: [&str; 5] = ["adaptable", "lookahead", "esterel", "guarded", "live"];
const WITH_LIKELIHOODS: usize = 2;

/// Random world, prepared for execution.
struct Scene {
    task: Arc<Task>,
    model: WorldModel,
    likelihoods: Arc<Likelihoods>,
    plan: TimeTriggeredPlan,
    text: String,
}

impl Scene {
    /// Returns the world of a seed, or `None` if it has no plan.
    fn of(seed: u64) -> Option<Self> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let world = SmallWorld::with_costly_failures(&mut rng);
        let (domain, problem) = (world.domain(), world.problem());
        let source = |text: &str| Source::new("test", text);
        let read = read_problem(&source(&domain), &source(&problem));
        let task = Arc::new(Task::new(read.expect("it is PDDL").0));
        let (file, odds) = (world.world(), world.likelihoods());
        let model = WorldModel::read(file.as_str(), task.problem()).expect("a world");
        let likelihoods = likelihoods::read(odds.as_str(), &task).expect("likelihoods");
        let answer = Embedded::default().plan(&task, &Situation::initial(&task));
        let PlanAnswer::Plan(plan) = answer.answer else {
            return None;
        };
        if plan.steps.is_empty() {
            return None;
        }
        Some(Self {
            task,
            model,
            likelihoods: Arc::new(likelihoods),
            plan,
            text: format!("{domain}\n{problem}\n{file}\n{odds}"),
        })
    }

    fn run(&self, executor: &str, seed: u64) -> Report {
        let execution = Execution::of(&self.task)
            .by(executor.parse().expect("it is registered"))
            .with_likelihoods(Arc::clone(&self.likelihoods))
            .beginning_with(self.plan.clone());
        execution.run_in(&mut *self.model.world(&self.task, seed))
    }

    /// Returns, for each run, `true` if it reaches the goal.
    fn runs(&self, executor: &str) -> Vec<bool> {
        let verdict = |seed| self.run(executor, seed).verdict == Verdict::GoalReached;
        (0..RUNS).map(verdict).collect()
    }

    /// Returns the success probability by the table of `lookahead`, if there is one.
    fn promise(&self) -> Option<f64> {
        let table = PolicyTable::new(&self.task, &self.likelihoods)?;
        Some(table.value(&SearchState::initial(&self.task)))
    }
}

/// Returns three standard errors of the share of runs that succeed.
#[allow(clippy::cast_precision_loss, reason = "there are few runs")]
fn doubt(share: f64) -> f64 {
    let share = share.clamp(0.0, 1.0);
    3.0 * (share * (1.0 - share)).sqrt() / (RUNS as f64).sqrt()
}

#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few runs")]
fn table_is_reached_and_no_other_executor_is_better_than_those_with_likelihoods() {
    let seeds = std::env::var("ELBOWROOM_WORLDS").ok();
    let seeds = seeds.map_or(40, |seeds| seeds.parse().expect("a number of seeds"));
    let (mut worlds, mut promises) = (0, 0);
    let mut broken = Vec::new();
    // By executor with and without likelihoods: the number of runs that only the second wins, and
    // that only the first wins.
    let mut pairs = [[(0.0_f64, 0.0_f64); EXECUTORS.len()]; WITH_LIKELIHOODS];
    for seed in 0..seeds {
        let Some(scene) = Scene::of(seed) else {
            continue;
        };
        let runs = EXECUTORS.map(|executor| scene.runs(executor));
        let share = |runs: &Vec<bool>| runs.iter().filter(|won| **won).count() as f64 / RUNS as f64;
        let shares = runs.each_ref().map(share);
        if shares.iter().all(|share| *share >= 1.0) {
            continue;
        }
        worlds += 1;
        let promise = scene.promise();
        println!("{seed}: {shares:.2?}, table {promise:.3?}");
        if let Some(promise) = promise {
            promises += 1;
            let foreseen = shares[1];
            if (foreseen - promise).abs() > doubt(promise) + 0.01 {
                broken.push(format!(
                    "{seed}: table {promise}, runs {foreseen}\n{}",
                    scene.text
                ));
            }
        }
        for (own, pairs) in pairs.iter_mut().enumerate() {
            for (other, pair) in pairs.iter_mut().enumerate() {
                let both = runs[own].iter().zip(&runs[other]);
                pair.0 += both
                    .clone()
                    .filter(|(own, other)| !**own && **other)
                    .count() as f64;
                pair.1 += both.filter(|(own, other)| **own && !**other).count() as f64;
            }
        }
    }
    println!("{worlds} uncertain worlds, {promises} with a table");
    for (own, pairs) in pairs.iter().enumerate() {
        for (other, (lost, won)) in pairs.iter().enumerate().skip(WITH_LIKELIHOODS) {
            let (own, other) = (EXECUTORS[own], EXECUTORS[other]);
            println!("only {other} {lost}, only {own} {won}");
            assert!(
                lost - won <= 3.0 * (lost + won).sqrt(),
                "{other} is better than {own}: {lost} against {won}"
            );
        }
    }
    assert!(
        broken.is_empty(),
        "{} broken\n{}",
        broken.len(),
        broken.join("\n")
    );
    assert!(worlds >= 10, "{worlds} uncertain worlds");
}
