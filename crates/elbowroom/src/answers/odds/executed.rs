//! What comes of executing the plan in samples of a world on a clock.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{Report, Verdict};
use elbowroom_execution::{NoPlanner, Planner};
use elbowroom_report::statistics::Proportion;
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

use super::{Subject, planner};
use crate::answers::Watcher;
use crate::execute::{Analyst, Execution, RememberingPlanner, RememberingPreparer};
use crate::flow;

/// The number of plans that are remembered.
const MEMORY: usize = 2000;

/// The results of executing the plan with one executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExecutedAnswer {
    /// By whom.
    pub executor: String,
    /// Whether new plans were made, by the embedded planner and in no time.
    pub replans: bool,
    /// How many samples were made.
    pub samples: u64,
    /// In how many the goal was reached.
    pub reached: u64,
    /// Wilson's 95 % interval of the probability; `None` without samples.
    pub interval: Option<(f64, f64)>,
    /// Why the others ended, the most frequent first.
    pub ends: Vec<EndAnswer>,
}

/// A reason for which samples did not reach the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EndAnswer {
    /// How often.
    pub samples: u64,
    /// The verdict on the run.
    pub verdict: String,
    /// Why the last plan was given up: a word of `docs/formats/trace.md`.
    pub cause: Option<String>,
    /// The action that this is about.
    pub action: Option<String>,
}

/// All executors, without and with new plans, in the same samples.
pub(super) fn all(
    subject: &Subject<'_>,
    world: &WorldModel,
    watcher: &mut dyn Watcher,
) -> Vec<ExecutedAnswer> {
    let executors = subject.request.settings.executors.iter();
    executors
        .flat_map(|executor| {
            [false, true].map(|replans| one(subject, world, executor, replans, watcher))
        })
        .collect()
}

fn one(
    subject: &Subject<'_>,
    world: &WorldModel,
    executor: &ExecutorSpec,
    replans: bool,
    watcher: &mut dyn Watcher,
) -> ExecutedAnswer {
    let request = subject.request;
    let mut planner: Box<dyn Planner> = if replans {
        Box::new(RememberingPlanner::new(planner(&request.settings), MEMORY))
    } else {
        Box::new(NoPlanner)
    };
    let analyst = Analyst::new(flow::Settings::default());
    let mut preparer = RememberingPreparer::new(analyst, MEMORY);
    let mut reached = Proportion::default();
    let mut ends: BTreeMap<(String, Option<String>, Option<String>), u64> = BTreeMap::new();
    for sample in 0..request.settings.samples {
        if watcher.flow().is_break() {
            break;
        }
        // Each sample is the same whichever came before.
        let task = Arc::new(request.task.with_own_table());
        let seed = request.settings.seed.wrapping_add(sample);
        let report = Execution::of(&task)
            .by(executor.clone())
            .beginning_with(subject.plan.clone())
            .with_likelihoods(Arc::clone(request.likelihoods))
            .planned_by(&mut *planner)
            .prepared_by(&mut preparer)
            .run_in(&mut *world.world(&task, seed));
        let is_reached = report.verdict == Verdict::GoalReached;
        reached.add(is_reached);
        if !is_reached {
            *ends.entry(end(&report)).or_default() += 1;
        }
    }
    let mut ends: Vec<EndAnswer> = ends
        .into_iter()
        .map(|((verdict, cause, action), samples)| EndAnswer {
            samples,
            verdict,
            cause,
            action,
        })
        .collect();
    // Those that are as frequent stay in the order of their words.
    ends.sort_by_key(|end| std::cmp::Reverse(end.samples));
    ExecutedAnswer {
        executor: executor.to_string(),
        replans,
        samples: reached.count,
        reached: reached.successes,
        interval: reached.wilson(),
        ends,
    }
}

fn end(report: &Report) -> (String, Option<String>, Option<String>) {
    let last = report.reasons.last();
    (
        report.verdict.name().to_owned(),
        last.map(|reason| reason.cause.name().to_owned()),
        last.and_then(|reason| reason.action.clone()),
    )
}
