//! Samples of one scene: [`Stage`].

use std::collections::BTreeMap;

use elbowroom_execution::executors::Orders;
use elbowroom_execution::run::{Amid, Beginning, Ports, Run, RunSettings, Verdict};
use elbowroom_execution::{
    Cause, Decided, Decision, Executor, Mission, Moment, Need, News, NoRecord, PlanAnswer, Planner,
    PlannerAnswer, PortWorkers, Preparer, Progression, Reason, Scene,
};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_sim::Seen;

use super::super::rollouts::{Metered, Rollouts};
use super::{Rehearse, SEED, Way};

/// Shared data of all samples of one scene.
pub(super) struct Stage {
    belief: Progression,
    seen: Seen,
    seed: u64,
    settings: RunSettings,
    planner: Box<dyn Planner>,
    orders: Orders,
}

impl Stage {
    pub(super) fn new(scene: &Scene<'_>, rollouts: &Rollouts) -> Self {
        // Samples must not add facts to the task's own table.
        let belief = scene.belief.with_own_table();
        let time = belief.time().to_string();
        // FNV-1a: each scene has different samples.
        let hash = time.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Self {
            seen: Seen {
                changes: scene.seen.to_vec(),
            },
            seed: SEED ^ (hash & 0xffff_ffff),
            settings: rollouts.settings.clone(),
            planner: Metered::boxed(rollouts.replanning.as_ref()),
            orders: Orders::default(),
            belief,
        }
    }

    /// Returns `true` if an alternative reaches the goal in a sample.
    pub(super) fn succeeds(
        &mut self,
        who: &mut Rehearse,
        scene: &Scene<'_>,
        way: &Way,
        sample: u64,
    ) -> bool {
        let going_on = scene.present.fork();
        let (executor, beginning, first) = match way {
            Way::AsDecided => (going_on, Beginning::GoesOn, None),
            Way::WaitsUntil(until) => {
                let waiting = going_on.map(|inner| {
                    let until = until.clone();
                    let news = Vec::new();
                    Box::new(Waiting { until, news, inner }) as Box<dyn Executor>
                });
                (waiting, Beginning::GoesOn, None)
            }
            Way::TakesUp(spec, mission) => {
                let beginning = Beginning::TakesUp(mission.clone());
                (
                    Some(who.built(spec, Some(self.orders.clone()))),
                    beginning,
                    None,
                )
            }
            Way::Replans(spec, plan) => {
                let reason = Reason::new(Cause::Likelier);
                let beginning = Beginning::Replans(reason);
                (
                    Some(who.built(spec, Some(self.orders.clone()))),
                    beginning,
                    plan.as_ref(),
                )
            }
        };
        let Some(executor) = executor else {
            return false;
        };
        let goes_on = matches!(beginning, Beginning::GoesOn);
        let amid = Amid {
            belief: self.belief.clone(),
            news: if goes_on {
                scene.news.to_vec()
            } else {
                Vec::new()
            },
            running: if goes_on {
                scene.running.clone()
            } else {
                BTreeMap::new()
            },
            replans: scene.replans,
        };
        let preparer: &mut dyn Preparer = &mut who.hasty;
        let planner = Planned {
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
        let report = run.go(
            &mut *world.world_amid(&self.belief, seed, &self.seen),
            &mut workers,
        );
        report.verdict == Verdict::GoalReached
    }
}

/// Planner with a prepared plan for one situation.
struct Planned<'p> {
    first: Option<&'p (Situation, TimeTriggeredPlan)>,
    planner: &'p mut dyn Planner,
}

impl Planner for Planned<'_> {
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
struct Waiting {
    until: Rational,
    /// Events received while waiting.
    news: Vec<News>,
    inner: Box<dyn Executor>,
}

impl Executor for Waiting {
    fn need(&self) -> Need {
        self.inner.need()
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        self.inner.adopt(mission)
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        self.news.extend_from_slice(moment.news);
        if *moment.now < self.until {
            return Decided {
                decision: Decision::Wait {
                    until: Some(self.until.clone()),
                },
                reason: Reason::new(Cause::NothingDue),
            };
        }
        let news = std::mem::take(&mut self.news);
        self.inner.decide(&Moment {
            news: &news,
            ..*moment
        })
    }
}
