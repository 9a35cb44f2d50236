//! Plans that are made ahead, in a thread of their own, while a plan is still executed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use elbowroom::execute::{FirstPlan, RunSpec};
use elbowroom::execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom::model::problem::Condition;
use elbowroom::model::{Situation, Step, Task, TimeTriggeredPlan};

use crate::clock::Clock;
use crate::interrupt::Interrupt;

/// A planner that begins with a plan as soon as it is told that it will be needed.
///
/// What is made ahead is made by the planner of the specification with a table of its own, so that
/// the answer is the same as if it was asked later.
pub(super) struct Ahead<'a> {
    inner: Box<dyn Planner + 'a>,
    spec: Arc<RunSpec>,
    interrupt: Interrupt,
    job: Option<Work>,
}

/// A plan in the making.
struct Work {
    situation: Situation,
    goal: Condition,
    is_needless: Arc<AtomicBool>,
    answer: JoinHandle<Option<PlanAnswer>>,
}

impl<'a> Ahead<'a> {
    pub(super) fn new(inner: Box<dyn Planner + 'a>, spec: &RunSpec, interrupt: &Interrupt) -> Self {
        // What is made ahead is no first plan.
        let spec = RunSpec {
            first_plan: FirstPlan::Shortest,
            ..spec.clone()
        };
        Self {
            inner,
            spec: Arc::new(spec),
            interrupt: interrupt.clone(),
            job: None,
        }
    }

    /// What was made for this, if it was.
    fn made(&mut self, task: &Task, situation: &Situation) -> Option<PlanAnswer> {
        let work = self.job.take()?;
        if work.situation != *situation || work.goal != task.problem().goal {
            work.is_needless.store(true, Ordering::SeqCst);
            return None;
        }
        match work.answer.join().ok()?? {
            PlanAnswer::Plan(plan) => renumbered(&plan, task, situation).map(PlanAnswer::Plan),
            other => Some(other),
        }
    }
}

impl Drop for Ahead<'_> {
    fn drop(&mut self) {
        if let Some(work) = &self.job {
            work.is_needless.store(true, Ordering::SeqCst);
        }
    }
}

impl Planner for Ahead<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let clock = Clock::start();
        if let Some(answer) = self.made(task, situation) {
            return PlannerAnswer {
                seconds: Some(clock.seconds()),
                ..PlannerAnswer::from(answer)
            };
        }
        self.inner.plan(task, situation)
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        if let Some(work) = self.job.take() {
            work.is_needless.store(true, Ordering::SeqCst);
        }
        // Who looks for likelier plans in a known world keeps what it has found out.
        if self.spec.executor.asks_odds() {
            return;
        }
        let is_needless = Arc::new(AtomicBool::new(false));
        let (spec, interrupt, stop) = (
            Arc::clone(&self.spec),
            self.interrupt.clone(),
            Arc::clone(&is_needless),
        );
        let (own, from) = (task.with_own_table(), situation.clone());
        let made = thread::Builder::new().spawn(move || {
            let begun = Clock::start();
            let clock = || begun.seconds();
            let goes_on = || !stop.load(Ordering::SeqCst) && !interrupt.is_requested();
            let mut planner = spec.planner_for(&own, None, &clock, &goes_on).ok()?;
            let answer = planner.plan(&own, &from).answer;
            goes_on().then_some(answer)
        });
        self.job = made.ok().map(|answer| Work {
            situation: situation.clone(),
            goal: task.problem().goal.clone(),
            is_needless,
            answer,
        });
    }
}

/// The same plan with the facts of this task.
fn renumbered(
    plan: &TimeTriggeredPlan,
    task: &Task,
    situation: &Situation,
) -> Option<TimeTriggeredPlan> {
    let problem = task.problem();
    let numbered = plan.steps.iter().enumerate();
    let steps = numbered.map(|(index, step)| {
        let action = if let Some(running) = situation.running.get(index) {
            Arc::clone(&running.action)
        } else {
            let name = step.action.name.trim_matches(['(', ')']);
            let mut words = name.split_whitespace();
            let schema = problem.schema(words.next()?)?;
            let objects: Option<Vec<_>> = words.map(|word| problem.object(word)).collect();
            Arc::new(task.instantiate(schema, &objects?).ok()?)
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
mod tests;
