//! Preparation of plans in the background.

use std::sync::Arc;

use elbowroom::execute::{ExactRegion, PlanPreparer, RunInputs};
use elbowroom::execution::executors::ExecutorSpec;
use elbowroom::execution::{
    PlanForm, PreparationRequest, PreparationResult, PrepareError, PreparedPlan, Preparer,
};
use elbowroom::model::{Task, TimeTriggeredPlan};

use crate::background_task::BackgroundTask;
use crate::completion_signal::{Completion, CompletionSignal};

/// Preparer that works in a thread and signals completion.
///
/// The thread has its own table of facts, so that the answer is the same as that of a preparer that is awaited. If the
/// preparation adds facts to that table, their numbers are unknown to the run; the plan is then prepared again when it
/// is collected.
pub struct BackgroundPreparer {
    analyst: PlanPreparer<'static>,
    executor: ExecutorSpec,
    signal: CompletionSignal,
    work: Option<Work>,
}

/// Preparation in progress. The result is `None` if it has added facts to the table of its thread.
type Work = BackgroundTask<Option<Result<PreparedPlan, PrepareError>>>;

impl BackgroundPreparer {
    /// Creates a preparer for a run, with the completion signal of the run.
    pub fn new(inputs: &RunInputs, signal: &CompletionSignal) -> Self {
        Self {
            analyst: inputs.preparer(),
            executor: inputs.spec().executor.clone(),
            signal: signal.clone(),
            work: None,
        }
    }

    /// Starts a thread that prepares a plan and its dispatchable networks.
    fn spawn(&self, wanted: &PreparationRequest<'_>) -> Option<Work> {
        let own = wanted.task.with_own_table();
        let (plan, situation) = (wanted.plan.clone(), wanted.situation.clone());
        let (running, now, need) = (wanted.running.to_vec(), wanted.now.clone(), wanted.need);
        let (analyst, executor) = (self.analyst.clone(), self.executor.clone());
        let work = BackgroundTask::spawn("preparer", &self.signal, move |cancel| {
            let cancel = cancel.clone();
            let mut analyst = analyst.stopped_unless(move || !cancel.is_requested());
            let before = size(&own);
            let mission = PreparationRequest {
                task: &own,
                plan: &plan,
                situation: &situation,
                running: &running,
                now: &now,
                need,
            }
            .prepare_now(&mut analyst);
            if let Ok(mission) = &mission
                && need != PlanForm::PartialOrder
                && !executor.uses_world_model()
            {
                // Fills the cache of dispatchable networks.
                let _ = executor.build(Box::new(ExactRegion)).adopt(mission);
            }
            (size(&own) == before).then_some(mission)
        });
        if let Some(work) = &work {
            work.arm(Completion::PlanReady);
        }
        work
    }
}

impl Drop for BackgroundPreparer {
    fn drop(&mut self) {
        self.give_up();
    }
}

impl Preparer for BackgroundPreparer {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        self.analyst.prepare(task, plan, need)
    }

    fn begin(&mut self, wanted: &PreparationRequest<'_>) -> bool {
        self.give_up();
        self.work = self.spawn(wanted);
        if self.work.is_none() {
            // Without a thread, the plan is prepared when it is collected, which is at once. The record contains the
            // start of the preparation.
            let (guard, is_done) = self.signal.guard();
            self.signal.arm(is_done, Completion::PlanReady);
            drop(guard);
        }
        true
    }

    fn collect(&mut self, wanted: &PreparationRequest<'_>) -> Result<PreparedPlan, PrepareError> {
        self.signal.disarm();
        let made = self.work.take().and_then(|work| work.join()?);
        match made {
            Some(Ok(mission)) => Ok(PreparedPlan {
                // With the run's own table.
                task: Arc::new(wanted.situation.remaining_task(wanted.task)),
                now: wanted.now.clone(),
                ..mission
            }),
            Some(Err(error)) => Err(error),
            None => wanted.prepare_now(&mut self.analyst),
        }
    }

    fn give_up(&mut self) {
        if self.work.take().is_some() {
            self.signal.disarm();
        }
    }
}

/// Returns the numbers of facts and fluents in the table.
fn size(task: &Task) -> (usize, usize) {
    (task.fact_count(), task.fluent_count())
}

#[cfg(test)]
mod tests;
