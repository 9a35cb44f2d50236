//! Plans that are made in a thread of their own, while the run goes on: when they are needed, or ahead
//! of that.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use elbowroom::execute::{FirstPlan, RunSpec};
use elbowroom::execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom::model::problem::Condition;
use elbowroom::model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom::num::work::Stop;

use crate::bell::{Bell, Ring};
use crate::interrupt::Interrupt;
use elbowroom_executive::clock::Clock;
use elbowroom_executive::memory_limit::MemoryLimit;

/// A planner that works aside: it begins with a plan as soon as it is told that it will be needed, and,
/// where the run goes on while plans are made, it rings when there is one.
///
/// What is made aside is made by the planner of the specification with a table of its own, so that
/// the answer is the same as if it was waited for.
pub(super) struct Ahead<'a> {
    inner: Box<dyn Planner + 'a>,
    spec: Arc<RunSpec>,
    aside: Aside,
    /// What was begun ahead.
    job: Option<Work>,
    /// What the run waits for.
    search: Option<Work>,
}

/// How plans are made aside.
#[derive(Clone)]
pub(in crate::commands) struct Aside {
    pub(in crate::commands) interrupt: Interrupt,
    /// Rings when a plan is there.
    pub(in crate::commands) bell: Bell,
    /// How many bytes planning may take, beyond what the process took before.
    pub(in crate::commands) most_memory: Option<u64>,
}

/// A plan in the making.
struct Work {
    situation: Situation,
    goal: Condition,
    is_needless: Arc<AtomicBool>,
    is_done: Arc<AtomicBool>,
    answer: JoinHandle<Option<PlannerAnswer>>,
}

impl Work {
    fn is_for(&self, task: &Task, situation: &Situation) -> bool {
        self.situation == *situation && self.goal == task.problem().goal
    }

    /// The answer, with the facts of this task, once it is there.
    fn answer(self, task: &Task, situation: &Situation) -> Option<PlannerAnswer> {
        let mut made = self.answer.join().ok()??;
        if let PlanAnswer::Plan(plan) = &made.answer {
            made.answer = PlanAnswer::Plan(renumbered(plan, task, situation)?);
        }
        Some(made)
    }
}

impl<'a> Ahead<'a> {
    pub(super) fn new(inner: Box<dyn Planner + 'a>, spec: &RunSpec, aside: &Aside) -> Self {
        // What is made ahead is no first plan.
        let spec = RunSpec {
            first_plan: FirstPlan::Shortest,
            ..spec.clone()
        };
        Self {
            inner,
            spec: Arc::new(spec),
            aside: aside.clone(),
            job: None,
            search: None,
        }
    }

    /// Has a thread make a plan.
    fn set_out(&self, task: &Task, situation: &Situation) -> Option<Work> {
        let is_needless = Arc::new(AtomicBool::new(false));
        let (clapper, is_done) = self.aside.bell.clapper();
        let (spec, interrupt, stop) = (
            Arc::clone(&self.spec),
            self.aside.interrupt.clone(),
            Arc::clone(&is_needless),
        );
        let most_memory = self.aside.most_memory;
        let (own, from) = (task.with_own_table(), situation.clone());
        let interrupted = Stop::of_this_thread();
        let made = thread::Builder::new()
            .name("planner".to_owned())
            .spawn(move || {
                let _rings = clapper;
                interrupted.iter().for_each(Stop::obey);
                let begun = Clock::start();
                let clock = || begun.seconds();
                let limit = most_memory.map(|most| Mutex::new(MemoryLimit::of(most)));
                let is_too_much = || {
                    limit.as_ref().is_some_and(|limit| {
                        let mut limit = limit.lock().unwrap_or_else(PoisonError::into_inner);
                        limit.is_exceeded()
                    })
                };
                let is_needed = || !stop.load(Ordering::SeqCst) && !interrupt.is_requested();
                let goes_on = || is_needed() && !is_too_much();
                let mut planner = spec.planner_for(&own, None, &clock, &goes_on).ok()?;
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
            is_needless,
            is_done,
            answer: made.ok()?,
        })
    }

    /// What was begun ahead, if it is for this.
    fn foreseen(&mut self, task: &Task, situation: &Situation) -> Option<Work> {
        let work = self.job.take()?;
        if work.is_for(task, situation) {
            return Some(work);
        }
        work.is_needless.store(true, Ordering::SeqCst);
        None
    }
}

impl Drop for Ahead<'_> {
    fn drop(&mut self) {
        for work in self.job.iter().chain(&self.search) {
            work.is_needless.store(true, Ordering::SeqCst);
        }
    }
}

impl Planner for Ahead<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let clock = Clock::start();
        let foreseen = self.foreseen(task, situation);
        if let Some(made) = foreseen.and_then(|work| work.answer(task, situation)) {
            return PlannerAnswer {
                seconds: Some(clock.seconds()),
                ..made
            };
        }
        self.inner.plan(task, situation)
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        if let Some(work) = self.job.take() {
            work.is_needless.store(true, Ordering::SeqCst);
        }
        // Who looks for likelier plans in a known world keeps what it has found out.
        if !self.spec.executor.asks_odds() {
            self.job = self.set_out(task, situation);
        }
    }

    fn begin(&mut self, task: &Task, situation: &Situation) -> bool {
        self.give_up();
        let foreseen = self.foreseen(task, situation);
        self.search = foreseen.or_else(|| self.set_out(task, situation));
        if let Some(work) = &self.search {
            self.aside
                .bell
                .follow(Arc::clone(&work.is_done), Ring::PlanMade);
        }
        self.search.is_some()
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.aside.bell.silence();
        let Some(work) = self.search.take() else {
            return self.inner.plan(task, situation);
        };
        work.answer(task, situation).unwrap_or_else(|| {
            let why = "planning was interrupted".to_owned();
            PlannerAnswer::from(PlanAnswer::NotFound { why })
        })
    }

    fn give_up(&mut self) {
        self.aside.bell.silence();
        if let Some(work) = self.search.take() {
            work.is_needless.store(true, Ordering::SeqCst);
        }
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
pub(super) mod tests;
