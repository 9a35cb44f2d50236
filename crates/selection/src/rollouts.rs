//! Rollouts: execution of a plan in samples of a world model.

use std::sync::Arc;

use elbowroom_execution::executors::{ExecutorSpec, PolicyTableCache};
use elbowroom_execution::run::{PlanningTime, RunSettings, Verdict};
use elbowroom_execution::{NoPlanner, PlanAnswer, Planner, PlannerAnswer, Preparer};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};
use elbowroom_planner::embedded;
use elbowroom_probability::Likelihoods;
use elbowroom_sim::WorldModel;

use crate::box_search::EnvelopeSettings;
use crate::cache::{CachingPlanner, CachingPreparer};
use crate::execution::Execution;
use crate::plan_preparer::PlanPreparer;
use crate::planners::Embedded;
use crate::renumbering::renumbered;

/// First seed of the samples, far from seeds that users choose.
const SEED: u64 = 0x7472_7900_0000_0000;

/// Size of the caches of planner and preparer.
const CACHE_SIZE: usize = 2_000;

/// Settings of rollouts.
#[derive(Clone)]
pub struct Rollouts {
    /// The world model.
    pub world: Arc<WorldModel>,
    /// The executor. One that uses a model of the world is replaced by the default executor.
    pub executor: ExecutorSpec,
    /// Settings of the runs.
    pub settings: RunSettings,
    /// The open quantities, and the search for envelopes.
    pub flow: EnvelopeSettings,
    /// The executor's likelihoods.
    pub likelihoods: Arc<Likelihoods>,
    /// Settings of replanning; without them, no new plans are made.
    pub replanning: Option<Replanning>,
    /// `true` if the plan is available at the start of the run. If `false`, it arrives after the
    /// expected planning time.
    pub is_ready: bool,
}

/// Maximum number of states of a search for a plan in a sample.
const MAX_STATES: u64 = 20_000;

/// Settings of replanning in rollouts.
#[derive(Clone, Debug)]
pub struct Replanning {
    /// Settings of the search.
    pub settings: embedded::Settings,
    /// See [`Embedded::most_states`].
    pub most_states: u64,
    /// See [`Embedded::improve_states`].
    pub improve_states: u64,
    /// See [`Embedded::work`].
    pub work: u64,
    /// Maximum number of states for all plans of all samples together. After that, requests that
    /// are not cached are answered as if there were no plan.
    pub all_states: u64,
}

impl Replanning {
    /// Returns the limits of a planner, but with at most 20,000 states for each plan, and ten times
    /// as many for all plans together. If no plan exists, a single sample must not use up the work
    /// of all.
    pub fn within(planner: &Embedded<'_>) -> Self {
        let most_states = planner.most_states.min(MAX_STATES);
        Self {
            settings: planner.settings.clone(),
            most_states,
            improve_states: planner.improve_states,
            work: planner.work,
            all_states: most_states.saturating_mul(10),
        }
    }
}

/// Executes plans of one problem in samples.
pub struct RolloutSession<'a> {
    rollouts: Rollouts,
    task: Arc<Task>,
    planner: Box<dyn Planner + 'a>,
    preparer: CachingPreparer<PlanPreparer<'static>>,
    foresight: PolicyTableCache,
}

impl<'a> RolloutSession<'a> {
    /// Creates it for a problem. `work` limits the work of all samples together, in units of
    /// [`elbowroom_num::work`].
    pub fn new(
        task: &Task,
        mut rollouts: Rollouts,
        work: u64,
        may_continue: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        if rollouts.executor.uses_world_model() {
            rollouts.executor = ExecutorSpec::default();
        }
        // A measured planning time is not known in advance.
        if rollouts.settings.planning_time == PlanningTime::Measured {
            rollouts.settings.planning_time = PlanningTime::Seconds(Rational::ZERO);
        }
        rollouts.settings.monitors_slack = false;
        rollouts.settings.plans_in_background = false;
        rollouts.settings.prepares_in_background = false;
        let planner: Box<dyn Planner + 'a> = match &rollouts.replanning {
            None => Box::new(NoPlanner),
            Some(replanning) => {
                let metered = BudgetedPlanner {
                    embedded: Embedded {
                        settings: replanning.settings.clone(),
                        most_states: replanning.most_states,
                        improve_states: replanning.improve_states,
                        work,
                        first_plan_factor: 1,
                        // Samples need no proof that no plan exists.
                        certificate_work: 0,
                        clock: None,
                        may_continue: Some(may_continue),
                    },
                    remaining_states: replanning.all_states,
                    budget: work::Budget::new(work),
                };
                Box::new(CachingPlanner::new(metered, CACHE_SIZE))
            }
        };
        let budget = work::Budget::new(work);
        let analyst =
            PlanPreparer::new(rollouts.flow.clone()).stopped_unless(move || !budget.is_spent());
        Self {
            planner,
            preparer: CachingPreparer::new(analyst, CACHE_SIZE),
            foresight: PolicyTableCache::default(),
            task: Arc::new(task.with_own_table()),
            rollouts,
        }
    }

    /// Returns `true` if this plan reaches the goal in a sample of the world. The result does not
    /// depend on earlier calls.
    pub fn succeeds(&mut self, plan: &TimeTriggeredPlan, sample: u64) -> bool {
        self.run(plan, sample, &mut Vec::new()) == Some(Verdict::GoalReached)
    }

    /// Returns the new plans that are made in a sample of the world after starting with this plan,
    /// without the actions that are already running.
    pub(super) fn new_plans(
        &mut self,
        plan: &TimeTriggeredPlan,
        sample: u64,
    ) -> Vec<TimeTriggeredPlan> {
        let mut made = Vec::new();
        self.run(plan, sample, &mut made);
        made
    }

    /// Returns the verdict of a run and appends the new plans to `made`; `None` if the plan is not
    /// one of the problem.
    fn run(
        &mut self,
        plan: &TimeTriggeredPlan,
        sample: u64,
        made: &mut Vec<TimeTriggeredPlan>,
    ) -> Option<Verdict> {
        let rollouts = &self.rollouts;
        // Later plans may contain facts that are not numbered in this table yet.
        let plan = renumbered(&self.task, plan)?;
        let task = Arc::new(self.task.with_own_table());
        let (first, later) = if rollouts.is_ready {
            (Some(plan), None)
        } else {
            (None, Some(plan))
        };
        let preparer: &mut dyn Preparer = &mut self.preparer;
        let execution = Execution::of(&task)
            .beginning_with(first)
            .by(rollouts.executor.clone())
            .with_settings(rollouts.settings.clone())
            .with_likelihoods(Arc::clone(&rollouts.likelihoods))
            .with_policy_tables(self.foresight.clone())
            .with_planner(ScriptedPlanner {
                first: later,
                planner: &mut *self.planner,
                made,
            })
            .with_preparer(preparer)
            .with_stop_check(work::is_stopped);
        let seed = SEED.wrapping_add(sample);
        let report = execution.run_in(&mut *rollouts.world.world(&task, seed));
        Some(report.verdict)
    }
}

/// Planner with a prepared first plan.
struct ScriptedPlanner<'p> {
    first: Option<TimeTriggeredPlan>,
    planner: &'p mut dyn Planner,
    /// All later plans.
    made: &'p mut Vec<TimeTriggeredPlan>,
}

impl Planner for ScriptedPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        if let Some(plan) = self.first.take() {
            return PlannerAnswer::from(PlanAnswer::Plan(plan));
        }
        let answer = self.planner.plan(task, situation);
        if let PlanAnswer::Plan(plan) = &answer.answer {
            let steps = plan.new_steps(situation).to_vec();
            self.made.push(TimeTriggeredPlan { steps });
        }
        answer
    }
}

/// The embedded planner, with a limit on the effort for all its plans together.
pub(super) struct BudgetedPlanner<'a> {
    embedded: Embedded<'a>,
    remaining_states: u64,
    budget: work::Budget,
}

impl BudgetedPlanner<'_> {
    /// Returns a planner with a cache, or [`NoPlanner`] without settings of replanning.
    pub(super) fn new_planner(replanning: Option<&Replanning>) -> Box<dyn Planner> {
        let Some(replanning) = replanning else {
            return Box::new(NoPlanner);
        };
        let metered = BudgetedPlanner {
            embedded: Embedded {
                settings: replanning.settings.clone(),
                most_states: replanning.most_states,
                improve_states: replanning.improve_states,
                work: replanning.work,
                first_plan_factor: 1,
                certificate_work: 0,
                clock: None,
                may_continue: None,
            },
            remaining_states: replanning.all_states,
            budget: work::Budget::new(replanning.work),
        };
        Box::new(CachingPlanner::new(metered, CACHE_SIZE))
    }
}

impl Planner for BudgetedPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.embedded.work = self.budget.remaining();
        if self.remaining_states == 0 || self.budget.is_spent() {
            return PlannerAnswer::from(PlanAnswer::NotFound {
                why: "the limit on rollouts is reached".to_owned(),
            });
        }
        let (answer, states) = self.embedded.plan_with_state_count(task, situation);
        // A plan without search also takes some time.
        self.remaining_states = self.remaining_states.saturating_sub(states.max(1));
        PlannerAnswer::from(answer)
    }
}
