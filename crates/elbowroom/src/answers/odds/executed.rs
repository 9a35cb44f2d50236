//! Results of executing the plan in samples of a world on a clock.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{Report, Verdict};
use elbowroom_execution::{NoPlanner, Planner};
use elbowroom_report::statistics::Proportion;
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

use super::{Subject, planner};
use crate::answers::Observer;
use crate::execute::{CachingPlanner, CachingPreparer, Execution, PlanPreparer};
use crate::pipeline;

/// Maximum number of cached plans.
const CACHE_SIZE: usize = 2000;

/// The results of executing the plan with one executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExecutedAnswer {
    /// The executor.
    pub executor: String,
    /// `true` if new plans were allowed. The embedded planner makes them, and planning takes no
    /// simulated time.
    pub replans: bool,
    /// Number of samples.
    pub samples: u64,
    /// Number of samples that reached the goal.
    pub reached: u64,
    /// Wilson's 95 % interval of the probability; `None` without samples.
    pub interval: Option<(f64, f64)>,
    /// Reasons for the end of the other samples, the most frequent first.
    pub ends: Vec<EndAnswer>,
}

/// A reason why samples did not reach the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EndAnswer {
    /// Number of these samples.
    pub samples: u64,
    /// The verdict of the run.
    pub verdict: String,
    /// The reason for abandoning the last plan: a word of `docs/formats/trace.md`.
    pub cause: Option<String>,
    /// The action that caused it.
    pub action: Option<String>,
}

/// Executes the plan with all executors, without and with new plans, in the same samples.
pub(super) fn execute_with_all(
    subject: &Subject<'_>,
    world: &WorldModel,
    watcher: &mut dyn Observer,
) -> Vec<ExecutedAnswer> {
    let executors = subject.request.settings.executors.iter();
    executors
        .flat_map(|executor| {
            [false, true].map(|replans| execute_with(subject, world, executor, replans, watcher))
        })
        .collect()
}

fn execute_with(
    subject: &Subject<'_>,
    world: &WorldModel,
    executor: &ExecutorSpec,
    replans: bool,
    watcher: &mut dyn Observer,
) -> ExecutedAnswer {
    let request = subject.request;
    let mut planner: Box<dyn Planner> = if replans {
        Box::new(CachingPlanner::new(planner(&request.settings), CACHE_SIZE))
    } else {
        Box::new(NoPlanner)
    };
    let analyst = PlanPreparer::new(pipeline::Settings::default());
    let mut preparer = CachingPreparer::new(analyst, CACHE_SIZE);
    let mut reached = Proportion::default();
    let mut ends: BTreeMap<(String, Option<String>, Option<String>), u64> = BTreeMap::new();
    for sample in 0..request.settings.samples {
        if watcher.flow().is_break() {
            break;
        }
        // A separate task makes each sample independent of the earlier ones.
        let task = Arc::new(request.task.with_own_table());
        let seed = request.settings.seed.wrapping_add(sample);
        let report = Execution::of(&task)
            .by(executor.clone())
            .beginning_with(subject.plan.clone())
            .with_likelihoods(Arc::clone(request.likelihoods))
            .with_planner(&mut *planner)
            .with_preparer(&mut preparer)
            .run_in(&mut *world.world(&task, seed));
        let is_reached = report.verdict == Verdict::GoalReached;
        reached.add(is_reached);
        if !is_reached {
            *ends.entry(describe_end(&report)).or_default() += 1;
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
    // A stable sort: equally frequent reasons keep the order of their words.
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

fn describe_end(report: &Report) -> (String, Option<String>, Option<String>) {
    let last = report.reasons.last();
    (
        report.verdict.name().to_owned(),
        last.map(|reason| reason.cause.name().to_owned()),
        last.and_then(|reason| reason.action.clone()),
    )
}
