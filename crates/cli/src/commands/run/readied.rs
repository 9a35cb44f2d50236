//! Plans that are made ready in a thread of their own, while the run goes on.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use elbowroom::execute::{Analyst, RunSpec, SpecError, WholeRegion};
use elbowroom::execution::executors::ExecutorSpec;
use elbowroom::execution::{Mission, Need, PrepareError, Prepared, Preparer, Wanted};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::work::Stop;

use crate::bell::{Bell, Ring};

/// A preparer that works aside, and rings when a plan is ready.
///
/// What is made ready aside is made ready with a table of its own, so that the answer is the same as if it
/// was waited for. If something is mentioned there for the first time, its number means nothing to the
/// run: then the plan is made ready once more when it is collected.
pub(super) struct Readied {
    analyst: Analyst,
    executor: ExecutorSpec,
    bell: Bell,
    work: Option<Work>,
}

/// A plan that is being made ready.
struct Work {
    is_needless: Arc<AtomicBool>,
    answer: JoinHandle<Option<Result<Mission, PrepareError>>>,
}

impl Readied {
    /// # Errors
    /// When the world file cannot be read.
    pub(super) fn new(spec: &RunSpec, task: &Task, bell: &Bell) -> Result<Self, SpecError> {
        Ok(Self {
            analyst: spec.analyst(task.problem())?,
            executor: spec.executor.clone(),
            bell: bell.clone(),
            work: None,
        })
    }

    /// Has a thread make a plan ready, and what its executor will ask of its network.
    fn set_out(&self, wanted: &Wanted<'_>) -> Option<Work> {
        let is_needless = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&is_needless);
        let (clapper, is_done) = self.bell.clapper();
        let own = wanted.task.with_own_table();
        let (plan, situation) = (wanted.plan.clone(), wanted.situation.clone());
        let (running, now, need) = (wanted.running.to_vec(), wanted.now.clone(), wanted.need);
        let (analyst, executor) = (self.analyst.clone(), self.executor.clone());
        let interrupted = Stop::of_this_thread();
        let made = thread::Builder::new().name("preparer".to_owned());
        let made = made.spawn(move || {
            let _rings = clapper;
            interrupted.iter().for_each(Stop::obey);
            let mut analyst = analyst.until(move || {
                if stop.load(Ordering::SeqCst) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            let before = size(&own);
            let mission = Wanted {
                task: &own,
                plan: &plan,
                situation: &situation,
                running: &running,
                now: &now,
                need,
            }
            .mission(&mut analyst);
            if let Ok(mission) = &mission
                && need != Need::PartialOrder
                && !executor.asks_odds()
            {
                // Whoever adopts it finds the forms of its network there.
                let _ = executor.build(Box::new(WholeRegion)).adopt(mission);
            }
            (size(&own) == before).then_some(mission)
        });
        let answer = made.ok()?;
        self.bell.follow(is_done, Ring::PlanReady);
        Some(Work {
            is_needless,
            answer,
        })
    }
}

impl Drop for Readied {
    fn drop(&mut self) {
        self.give_up();
    }
}

impl Preparer for Readied {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: Need,
    ) -> Result<Prepared, PrepareError> {
        self.analyst.prepare(task, plan, need)
    }

    fn begin(&mut self, wanted: &Wanted<'_>) -> bool {
        self.give_up();
        self.work = self.set_out(wanted);
        if self.work.is_none() {
            // Without a thread it is made ready when it is collected, which is at once. That it was begun
            // is part of the record.
            let (clapper, is_done) = self.bell.clapper();
            self.bell.follow(is_done, Ring::PlanReady);
            drop(clapper);
        }
        true
    }

    fn collect(&mut self, wanted: &Wanted<'_>) -> Result<Mission, PrepareError> {
        self.bell.silence();
        let made = self.work.take().and_then(|work| work.answer.join().ok()?);
        match made {
            Some(Ok(mission)) => Ok(Mission {
                // With the run's own table.
                task: Arc::new(wanted.situation.rest_of_task(wanted.task)),
                now: wanted.now.clone(),
                ..mission
            }),
            Some(Err(error)) => Err(error),
            None => wanted.mission(&mut self.analyst),
        }
    }

    fn give_up(&mut self) {
        if let Some(work) = self.work.take() {
            self.bell.silence();
            work.is_needless.store(true, Ordering::SeqCst);
        }
    }
}

/// How many facts and fluents have been mentioned.
fn size(task: &Task) -> (usize, usize) {
    (task.fact_count(), task.fluent_count())
}

#[cfg(test)]
mod tests;
