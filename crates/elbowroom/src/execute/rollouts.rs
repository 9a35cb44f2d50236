//! Trying a plan out in samples of a world that is known by its distributions.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_execution::executors::{ExecutorSpec, Foresight};
use elbowroom_execution::run::{PlanningTime, RunSettings, Verdict};
use elbowroom_execution::{NoPlanner, PlanAnswer, Planner, PlannerAnswer, Preparer};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};
use elbowroom_planner::embedded;
use elbowroom_probability::Likelihoods;
use elbowroom_sim::WorldModel;

use super::first_plan::renumbered;
use super::{Analyst, Embedded, Execution, RememberingPlanner, RememberingPreparer};
use crate::flow;

/// Where the seeds of the samples begin: far from those that people choose.
const SEED: u64 = 0x7472_7900_0000_0000;

/// How many answers of planner and preparer are remembered.
const MEMORY: usize = 2_000;

/// Who tries plans out, and in what.
#[derive(Clone)]
pub struct Rollouts {
    /// The world, of which nothing is known but its distributions.
    pub world: Arc<WorldModel>,
    /// Who executes. One that chooses among plans by itself on the way is taken as `live`.
    pub executor: ExecutorSpec,
    /// How to run.
    pub settings: RunSettings,
    /// What is left open, and how envelopes are searched for.
    pub flow: flow::Settings,
    /// What the executor takes to be likely.
    pub likelihoods: Arc<Likelihoods>,
    /// The planner for new plans on the way: its settings, the states that it may look at for one
    /// plan and for a better one, and for all together; without it, none are made.
    pub replanning: Option<Replanning>,
    /// Whether the plan is there when the run begins. If not, it comes as soon as planning is
    /// expected to be over.
    pub is_ready: bool,
}

/// The states that a search for a plan in a sample may examine.
const MOST_STATES: u64 = 20_000;

/// Making new plans on the way.
#[derive(Clone, Debug)]
pub struct Replanning {
    /// How to plan.
    pub settings: embedded::Settings,
    /// See [`Embedded::most_states`].
    pub most_states: u64,
    /// See [`Embedded::improve_states`].
    pub improve_states: u64,
    /// See [`Embedded::work`].
    pub work: u64,
    /// The states that all plans of all samples may take together. What is not remembered after
    /// that counts as if there were no plan.
    pub all_states: u64,
}

impl Replanning {
    /// As a planner is limited, but with at most 20,000 states for each plan, and ten times as many for all plans
    /// together: where no plan exists, one sample must not use up the work of all.
    pub fn within(planner: &Embedded<'_>) -> Self {
        let most_states = planner.most_states.min(MOST_STATES);
        Self {
            settings: planner.settings.clone(),
            most_states,
            improve_states: planner.improve_states,
            work: planner.work,
            all_states: most_states.saturating_mul(10),
        }
    }
}

/// Tries plans of one problem out.
pub struct Tryout<'a> {
    rollouts: Rollouts,
    task: Arc<Task>,
    planner: Box<dyn Planner + 'a>,
    preparer: RememberingPreparer<Analyst>,
    foresight: Foresight,
}

impl<'a> Tryout<'a> {
    /// Of this problem. `work`: what all samples may take together, in the units of [`elbowroom_num::work`].
    pub fn new(
        task: &Task,
        mut rollouts: Rollouts,
        work: u64,
        goes_on: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        if rollouts.executor.asks_odds()
            && let Ok(live) = "live".parse()
        {
            rollouts.executor = live;
        }
        // What planning takes on a clock is not known beforehand.
        if rollouts.settings.planning_time == PlanningTime::Measured {
            rollouts.settings.planning_time = PlanningTime::Seconds(Rational::ZERO);
        }
        rollouts.settings.watches_room = false;
        rollouts.settings.plans_aside = false;
        rollouts.settings.readies_aside = false;
        let planner: Box<dyn Planner + 'a> = match &rollouts.replanning {
            None => Box::new(NoPlanner),
            Some(replanning) => {
                let metered = Metered {
                    embedded: Embedded {
                        settings: replanning.settings.clone(),
                        most_states: replanning.most_states,
                        improve_states: replanning.improve_states,
                        work,
                        patience: 1,
                        // A sample says nothing about whether a plan exists.
                        certificate_work: 0,
                        clock: None,
                        goes_on: Some(goes_on),
                    },
                    left: replanning.all_states,
                    budget: work::Budget::new(work),
                };
                Box::new(RememberingPlanner::new(metered, MEMORY))
            }
        };
        let budget = work::Budget::new(work);
        let analyst = Analyst::new(rollouts.flow.clone()).until(move || {
            if budget.is_spent() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        Self {
            planner,
            preparer: RememberingPreparer::new(analyst, MEMORY),
            foresight: Foresight::default(),
            task: Arc::new(task.with_own_table()),
            rollouts,
        }
    }

    /// Whether the goal is reached in a sample of the world, beginning with this plan. The same
    /// plan succeeds in the same samples, whatever else was tried out.
    pub fn succeeds(&mut self, plan: &TimeTriggeredPlan, sample: u64) -> bool {
        self.run(plan, sample, &mut Vec::new()) == Some(Verdict::GoalReached)
    }

    /// The new plans that are made in a sample of the world, beginning with this plan, without what is under way when
    /// they begin.
    pub(super) fn new_plans(
        &mut self,
        plan: &TimeTriggeredPlan,
        sample: u64,
    ) -> Vec<TimeTriggeredPlan> {
        let mut made = Vec::new();
        self.run(plan, sample, &mut made);
        made
    }

    /// How a run ends, and the plans that are `made` in it; `None` if the plan is none of the problem's.
    fn run(
        &mut self,
        plan: &TimeTriggeredPlan,
        sample: u64,
        made: &mut Vec<TimeTriggeredPlan>,
    ) -> Option<Verdict> {
        let rollouts = &self.rollouts;
        // Plans that were made later may be about facts that have no number here yet.
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
            .with_foresight(self.foresight.clone())
            .planned_by(Scripted {
                first: later,
                planner: &mut *self.planner,
                made,
            })
            .prepared_by(preparer);
        let seed = SEED.wrapping_add(sample);
        let report = execution.run_in(&mut *rollouts.world.world(&task, seed));
        Some(report.verdict)
    }
}

/// Has its first plan already.
struct Scripted<'p> {
    first: Option<TimeTriggeredPlan>,
    planner: &'p mut dyn Planner,
    /// All others that it gave.
    made: &'p mut Vec<TimeTriggeredPlan>,
}

impl Planner for Scripted<'_> {
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

/// The embedded planner, with a limit on what all its plans take together.
pub(super) struct Metered<'a> {
    embedded: Embedded<'a>,
    left: u64,
    budget: work::Budget,
}

impl Metered<'_> {
    /// One that remembers what it was asked, or nobody if there is none.
    pub(super) fn boxed(replanning: Option<&Replanning>) -> Box<dyn Planner> {
        let Some(replanning) = replanning else {
            return Box::new(NoPlanner);
        };
        let metered = Metered {
            embedded: Embedded {
                settings: replanning.settings.clone(),
                most_states: replanning.most_states,
                improve_states: replanning.improve_states,
                work: replanning.work,
                patience: 1,
                certificate_work: 0,
                clock: None,
                goes_on: None,
            },
            left: replanning.all_states,
            budget: work::Budget::new(replanning.work),
        };
        Box::new(RememberingPlanner::new(metered, MEMORY))
    }
}

impl Planner for Metered<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.embedded.work = self.budget.left();
        if self.left == 0 || self.budget.is_spent() {
            return PlannerAnswer::from(PlanAnswer::NotFound {
                why: "the limit on what trying plans out may take is reached".to_owned(),
            });
        }
        let (answer, states) = self.embedded.counted(task, situation);
        // Even a plan that takes no search takes some time.
        self.left = self.left.saturating_sub(states.max(1));
        PlannerAnswer::from(answer)
    }
}
