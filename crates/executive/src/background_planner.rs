//! Planning in the background: a thread makes a plan during the run, on demand or in advance.

use std::sync::{Arc, Mutex, PoisonError};

use elbowroom::execute::{FirstPlan, RunSpec};
use elbowroom::execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom::model::problem::Condition;
use elbowroom::model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom::num::work::Stop;
use elbowroom::report::trace::action_named;

use crate::background_task::BackgroundTask;
use crate::clock::Clock;
use crate::completion_signal::{Completion, CompletionSignal};
use crate::memory_limit::MemoryLimit;

/// Planner decorator that plans in a thread. It starts as soon as a plan is expected, and signals completion if the run
/// continues during planning.
///
/// The thread uses the planner of the specification with its own table of facts, so that the answer is the same as
/// that of a planner that is awaited.
pub struct BackgroundPlanner<'a> {
    inner: Box<dyn Planner + 'a>,
    spec: Arc<RunSpec>,
    settings: BackgroundSettings,
    /// Plan that was begun in advance.
    job: Option<Work>,
    /// Plan that the run awaits.
    search: Option<Work>,
}

/// Settings of background planning.
#[derive(Clone, Default)]
pub struct BackgroundSettings {
    /// Stop request of the run. It also ends planning.
    pub stop: Stop,
    /// Signals completion.
    pub signal: CompletionSignal,
    /// Limit on the memory of planning, in bytes above the memory of the process at its start.
    pub memory_limit: Option<u64>,
}

/// Planning in progress. The answer is `None` if it was cancelled.
struct Work {
    situation: Situation,
    goal: Condition,
    answer: BackgroundTask<Option<PlannerAnswer>>,
}

impl Work {
    fn is_for(&self, task: &Task, situation: &Situation) -> bool {
        self.situation == *situation && self.goal == task.problem().goal
    }

    /// Waits for the answer. Returns it with the fact numbers of `task`, or `None` if planning was interrupted.
    fn answer(self, task: &Task, situation: &Situation) -> Option<PlannerAnswer> {
        let mut made = self.answer.join()??;
        if let PlanAnswer::Plan(plan) = &made.answer {
            made.answer = PlanAnswer::Plan(renumbered(plan, task, situation)?);
        }
        Some(made)
    }
}

impl<'a> BackgroundPlanner<'a> {
    /// Creates a planner for runs of `spec`. `inner` makes the plans that were not begun in the
    /// background.
    pub fn new(
        inner: Box<dyn Planner + 'a>,
        spec: &RunSpec,
        settings: &BackgroundSettings,
    ) -> Self {
        // A plan in advance is never the first plan.
        let spec = RunSpec {
            first_plan: FirstPlan::Shortest,
            ..spec.clone()
        };
        Self {
            inner,
            spec: Arc::new(spec),
            settings: settings.clone(),
            job: None,
            search: None,
        }
    }

    /// Starts a thread that makes a plan.
    fn spawn(&self, task: &Task, situation: &Situation) -> Option<Work> {
        let (spec, run_stop) = (Arc::clone(&self.spec), self.settings.stop.clone());
        let most_memory = self.settings.memory_limit;
        let (own, from) = (task.with_own_table(), situation.clone());
        let signal = &self.settings.signal;
        let answer = BackgroundTask::spawn("planner", signal, move |cancel| {
            let begun = Clock::start();
            let clock = || begun.seconds();
            let limit = most_memory.map(|most| Mutex::new(MemoryLimit::of(most)));
            let is_too_much = || {
                limit.as_ref().is_some_and(|limit| {
                    let mut limit = limit.lock().unwrap_or_else(PoisonError::into_inner);
                    limit.is_exceeded()
                })
            };
            let is_needed = || !cancel.is_requested() && !run_stop.is_requested();
            let may_continue = || is_needed() && !is_too_much();
            let mut planner = spec
                .planner_of_new_plans(None, &clock, &may_continue)
                .ok()?;
            let mut made = planner.plan(&own, &from);
            if is_too_much() && !matches!(made.answer, PlanAnswer::Plan(_)) {
                let most = most_memory.unwrap_or_default() >> 20;
                made.answer = PlanAnswer::NotFound {
                    why: format!("no plan was found with {most} MB (--planner-memory)"),
                };
            }
            is_needed().then_some(made)
        });
        Some(Work {
            situation: situation.clone(),
            goal: task.problem().goal.clone(),
            answer: answer?,
        })
    }

    /// Returns the plan that was begun in advance, if it is for this situation; cancels it otherwise.
    fn take_expected(&mut self, task: &Task, situation: &Situation) -> Option<Work> {
        self.job.take().filter(|work| work.is_for(task, situation))
    }
}

impl Planner for BackgroundPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let clock = Clock::start();
        let expected = self.take_expected(task, situation);
        if let Some(made) = expected.and_then(|work| work.answer(task, situation)) {
            return PlannerAnswer {
                seconds: Some(clock.seconds()),
                ..made
            };
        }
        self.inner.plan(task, situation)
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        self.job = None;
        // A planner that compares probabilities reuses results for later plans.
        if !self.spec.executor.needs_odds() {
            self.job = self.spawn(task, situation);
        }
    }

    fn begin(&mut self, task: &Task, situation: &Situation) -> bool {
        self.give_up();
        let expected = self.take_expected(task, situation);
        self.search = expected.or_else(|| self.spawn(task, situation));
        if let Some(work) = &self.search {
            work.answer.arm(Completion::PlanMade);
        }
        self.search.is_some()
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.settings.signal.disarm();
        let Some(work) = self.search.take() else {
            return self.inner.plan(task, situation);
        };
        work.answer(task, situation).unwrap_or_else(|| {
            let why = "planning was interrupted".to_owned();
            PlannerAnswer::from(PlanAnswer::NotFound { why })
        })
    }

    fn give_up(&mut self) {
        self.settings.signal.disarm();
        self.search = None;
    }
}

/// Returns the plan with the fact numbers of `task`.
fn renumbered(
    plan: &TimeTriggeredPlan,
    task: &Task,
    situation: &Situation,
) -> Option<TimeTriggeredPlan> {
    let numbered = plan.steps.iter().enumerate();
    let steps = numbered.map(|(index, step)| {
        let action = if let Some(running) = situation.running.get(index) {
            Arc::clone(&running.action)
        } else {
            Arc::new(action_named(&step.action.name, task).ok()?)
        };
        Some(Step {
            action,
            start: step.start.clone(),
            duration: step.duration.clone(),
        })
    });
    let steps = steps.collect::<Option<Vec<_>>>()?;
    Some(TimeTriggeredPlan { steps })
}

#[cfg(test)]
pub(crate) mod tests;
