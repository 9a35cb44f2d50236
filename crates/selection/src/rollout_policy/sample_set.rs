//! Samples of one scene: [`SampleSet`].

use std::collections::BTreeMap;

use elbowroom_execution::executors::OrderCache;
use elbowroom_execution::run::{EntryPoint, MidExecutionStart, Ports, Run, RunSettings, Verdict};
use elbowroom_execution::{
    BeliefState, Cause, Decided, Decision, DecisionContext, DecisionPoint, Executor, NoRecord,
    PlanAnswer, PlanEvent, PlanForm, Planner, PlannerAnswer, PortWorkers, PreparedPlan, Preparer,
    Reason,
};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_sim::ObservedChanges;

use super::{Alternative, RolloutPolicy, SEED};
use crate::rollouts::{BudgetedPlanner, Rollouts};

/// Shared data of all samples of one scene.
pub(super) struct SampleSet {
    belief: BeliefState,
    seen: ObservedChanges,
    seed: u64,
    settings: RunSettings,
    planner: Box<dyn Planner>,
    orders: OrderCache,
}

impl SampleSet {
    pub(super) fn new(scene: &DecisionPoint<'_>, rollouts: &Rollouts) -> Self {
        // Samples must not add facts to the task's own table.
        let belief = scene.belief.with_separate_fact_table();
        let time = belief.time().to_string();
        // FNV-1a: each scene has different samples.
        let hash = time.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Self {
            seen: ObservedChanges {
                changes: scene.observed_changes.to_vec(),
            },
            seed: SEED ^ (hash & 0xffff_ffff),
            settings: rollouts.settings.clone(),
            planner: BudgetedPlanner::new_planner(rollouts.replanning.as_ref()),
            orders: OrderCache::default(),
            belief,
        }
    }

    /// Returns `true` if an alternative reaches the goal in a sample.
    pub(super) fn succeeds(
        &mut self,
        who: &mut RolloutPolicy,
        scene: &DecisionPoint<'_>,
        way: &Alternative,
        sample: u64,
    ) -> bool {
        let going_on = scene.executor.fork();
        let (executor, beginning, first) = match way {
            Alternative::Unchanged => (going_on, EntryPoint::Continue, None),
            Alternative::WaitUntil(until) => {
                let waiting = going_on.map(|inner| {
                    let until = until.clone();
                    let news = Vec::new();
                    Box::new(WaitingExecutor {
                        until,
                        pending_events: news,
                        inner,
                    }) as Box<dyn Executor>
                });
                (waiting, EntryPoint::Continue, None)
            }
            Alternative::AdoptRemaining(spec, mission) => {
                let beginning = EntryPoint::Adopt(mission.clone());
                (
                    Some(who.build_executor(spec, Some(self.orders.clone()))),
                    beginning,
                    None,
                )
            }
            Alternative::Replan(spec, plan) => {
                let reason = Reason::new(Cause::Likelier);
                let beginning = EntryPoint::Replan(reason);
                (
                    Some(who.build_executor(spec, Some(self.orders.clone()))),
                    beginning,
                    plan.as_ref(),
                )
            }
        };
        let Some(executor) = executor else {
            return false;
        };
        let may_continue = matches!(beginning, EntryPoint::Continue);
        let amid = MidExecutionStart {
            belief: self.belief.clone(),
            plan_events: if may_continue {
                scene.plan_events.to_vec()
            } else {
                Vec::new()
            },
            running: if may_continue {
                scene.running.clone()
            } else {
                BTreeMap::new()
            },
            replans: scene.replans,
        };
        let preparer: &mut dyn Preparer = &mut who.sample_preparer;
        let planner = PreparedPlanner {
            first,
            planner: self.planner.as_mut(),
        };
        let mut workers = PortWorkers::new(planner, preparer);
        let ports = Ports {
            executor,
            recorder: Box::new(NoRecord),
        };
        let run = Run::amid(amid, beginning, self.settings.clone(), ports);
        let seed = self.seed.wrapping_add(sample << 32);
        let world = &who.rollouts.world;
        let report = run.run_to_end(
            &mut *world.world_in_mid_execution(&self.belief, seed, &self.seen),
            &mut workers,
        );
        report.verdict == Verdict::GoalReached
    }
}

/// Planner with a prepared plan for one situation.
struct PreparedPlanner<'p> {
    first: Option<&'p (Situation, TimeTriggeredPlan)>,
    planner: &'p mut dyn Planner,
}

impl Planner for PreparedPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        match self.first.take() {
            Some((known, plan)) if known == situation => {
                PlannerAnswer::from(PlanAnswer::Plan(plan.clone()))
            }
            _ => self.planner.plan(task, situation),
        }
    }
}

/// Executor that starts no action before a given time.
struct WaitingExecutor {
    until: Rational,
    /// Events received while waiting.
    pending_events: Vec<PlanEvent>,
    inner: Box<dyn Executor>,
}

impl Executor for WaitingExecutor {
    fn need(&self) -> PlanForm {
        self.inner.need()
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        self.inner.adopt(mission)
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        self.pending_events.extend_from_slice(moment.plan_events);
        if *moment.now < self.until {
            return Decided {
                decision: Decision::Wait {
                    until: Some(self.until.clone()),
                },
                reason: Reason::new(Cause::NothingDue),
            };
        }
        let news = std::mem::take(&mut self.pending_events);
        self.inner.decide(&DecisionContext {
            plan_events: &news,
            ..*moment
        })
    }
}
