//! Results of executing the plan in samples of a world on a clock.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{Report, RunSettings, Verdict};
use elbowroom_execution::{ActionValues, NoPlanner, PlanComparator, Planner};
use elbowroom_mdp::Settings;
use elbowroom_num::{Rational, work};
use elbowroom_report::statistics::Proportion;
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

use super::{Subject, planner};
use crate::answers::Observer;
use crate::execute::{
    CachingPlanner, CachingPreparer, Embedded, Execution, MostProbablePlanner, PLANNING_BUDGET,
    PlanPreparer, Replanning, RolloutPolicy, Rollouts, SharedMostProbablePlanner,
    SharedRolloutPolicy, action_values, planning_work,
};
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
    /// The reason for abandoning the last plan: a word of `docs/reference/formats/trace.md`.
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
    let services = Services::new(subject, world, executor);
    let mut planner: Box<dyn Planner> = match (&services.comparator, replans) {
        (_, false) => Box::new(NoPlanner),
        (Some(comparator), true) => Box::new(CachingPlanner::new(comparator.clone(), CACHE_SIZE)),
        (None, true) => Box::new(CachingPlanner::new(planner(&request.settings), CACHE_SIZE)),
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
            .with_plan_comparator(services.comparator())
            .with_action_values(services.action_values.clone())
            .with_rollouts(services.rollouts.clone())
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

/// Services for the executor, computed from the world of the samples.
struct Services {
    comparator: Option<SharedMostProbablePlanner>,
    action_values: Option<Arc<dyn ActionValues>>,
    rollouts: Option<SharedRolloutPolicy>,
}

impl Services {
    fn new(subject: &Subject<'_>, world: &WorldModel, executor: &ExecutorSpec) -> Self {
        let request = subject.request;
        let planner = || Embedded {
            work: planning_work(&Rational::from(PLANNING_BUDGET)),
            ..planner(&request.settings)
        };
        let action_values = executor.needs().action_values.then(|| {
            let budget = work::Budget::new(planner().work);
            let may_continue = || !budget.is_spent();
            action_values(
                request.task,
                world,
                Some(planner()),
                Some(subject.plan),
                Settings::default(),
                &may_continue,
            )
            .ok()
        });
        let action_values = action_values.flatten();
        let rollouts = (executor.needs().rollouts && action_values.is_none()).then(|| {
            let rollouts = Rollouts {
                world: Arc::new(world.clone()),
                executor: ExecutorSpec::default(),
                settings: RunSettings::default(),
                flow: pipeline::Settings::default(),
                likelihoods: Arc::clone(request.likelihoods),
                replanning: Some(Replanning::within(&planner())),
                is_ready: true,
            };
            SharedRolloutPolicy::new(RolloutPolicy::new(rollouts, planner()))
        });
        let comparator = executor.needs_odds().then(|| {
            let planner = MostProbablePlanner::new(world.clone(), planner(), Rational::ZERO);
            SharedMostProbablePlanner::new(planner)
        });
        Self {
            comparator,
            action_values,
            rollouts,
        }
    }

    fn comparator(&self) -> Option<Box<dyn PlanComparator>> {
        let comparator = self.comparator.clone()?;
        Some(Box::new(comparator))
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
