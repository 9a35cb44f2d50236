//! A detour for problems with tight deadlines: plans of the problem without its last deadlines are
//! improved until one of them is in time.
//!
//! Deadlines make states dead ends, and best-first search then revises the last choices of a plan
//! whose first choices took too long. Without the deadlines, a first plan is found soon, and the
//! [search near it](super::local_search) shortens it as a whole (as in scheduling, where due dates
//! are treated as an objective first). A plan that the validator accepts under the original
//! deadlines is a plan of the problem. The detour proves nothing.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use elbowroom_model::problem::{TimedChange, TimedInitial};
use elbowroom_model::validate::{self, Verdict, validate_from};
use elbowroom_model::{Situation, Task};
use elbowroom_num::work;

use super::answer::{Answer, Counts, FoundPlan, Objective, Progress, Settings, Stopped};
use super::tuning::Technique;

/// Maximum work of a detour for each unit of work of the search before it.
const DETOUR_SHARE: u64 = 2;

/// Divisor of the work of a detour: it ends if it has no plan by then.
const FIRST_PLAN_SHARE: u64 = 2;

/// The search near the best plan.
const REFINEMENTS: [Technique; 2] = [Technique::Rescheduling, Technique::Repair];

/// Search for plans, with detours.
pub(super) struct Detours<'a> {
    task: &'a Task,
    situation: &'a Situation,
    settings: &'a Settings,
    /// Work of the search at which the next detour begins.
    next: u64,
    /// Work of the detours so far.
    counts: Counts,
    has_plan: bool,
    found: Option<Found>,
}

/// Plan of a detour.
struct Found {
    plan: FoundPlan,
    /// Reason for the end of the run; `None` if it continues with better plans.
    stopped: Option<Stopped>,
}

impl<'a> Detours<'a> {
    /// Returns `None` if the task has no deadlines, or detours are switched off.
    pub(super) fn new(
        task: &'a Task,
        situation: &'a Situation,
        settings: &'a Settings,
    ) -> Option<Self> {
        let is_used = settings.tuning.uses(Technique::Detours) && settings.tuning.only.is_none();
        let mut timed = task.problem().timed.iter();
        let has_deadlines = timed.any(|timed| may_be_deadline(timed, situation));
        (is_used && has_deadlines).then_some(Self {
            task,
            situation,
            settings,
            next: settings.tuning.detour_after,
            counts: Counts::default(),
            has_plan: false,
            found: None,
        })
    }

    /// Passes on the progress of the search, and makes a detour if one is due.
    pub(super) fn observe(
        &mut self,
        progress: &Progress,
        observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.has_plan |= progress.best.is_some();
        let mut progress = progress.clone();
        let own_work = progress.counts.work;
        progress.counts = progress.counts.after(&self.counts);
        observe(&progress)?;
        if self.has_plan || own_work < self.next {
            return ControlFlow::Continue(());
        }
        self.next = own_work.saturating_mul(4);
        // The thread that runs the detour depends on the number of threads.
        let flow = work::with_fixed_cost(|| self.detour(&progress, own_work, observe), |_| 0);
        if self.found.is_some() {
            return ControlFlow::Break(());
        }
        flow
    }

    /// Improves plans without the last deadlines until one is in time, and if shorter plans are
    /// better, further until it is stopped. `own_work` is the work of the search so far.
    fn detour(
        &mut self,
        before: &Progress,
        own_work: u64,
        observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let memory = self.settings.max_memory;
        let mut tuning = self.settings.tuning.clone();
        // Some callers switch refinements off. A detour finds its plan by them.
        tuning.without.retain(|it| !REFINEMENTS.contains(it));
        let settings = Settings {
            tuning,
            max_memory: memory.saturating_sub(before.counts.memory),
            first_plan_only: false,
            objective: Objective::Makespan,
            ..self.settings.clone()
        };
        let (mut outer_flow, mut found) = (ControlFlow::Continue(()), None::<FoundPlan>);
        let (task, situation) = (self.task, self.situation);
        let mut report = |progress: &Progress| {
            let mut passed = before.clone();
            passed.counts = progress.counts.after(&before.counts);
            passed.counts.memory = before.counts.memory + progress.counts.memory;
            let plan = progress.plan.as_ref();
            passed.plan = plan.and_then(|plan| in_time(task, situation, self.settings, plan));
            if passed.plan.is_some() {
                found.clone_from(&passed.plan);
            }
            passed.best = found.as_ref().map(|found| found.value.clone());
            outer_flow = observe(&passed);
            outer_flow?;
            let has_time = match (&found, &progress.best) {
                (Some(found), _) => !self.settings.first_plan_only && found.value == found.makespan,
                (None, Some(_)) => progress.counts.work < DETOUR_SHARE * own_work,
                (None, None) => progress.counts.work < DETOUR_SHARE * own_work / FIRST_PLAN_SHARE,
            };
            if has_time {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        };
        let relaxed = without_last_deadlines(task, situation);
        let answer = super::search_for_plans(&relaxed, None, situation, &settings, &mut report);
        if let Some(counts) = answer.counts() {
            self.counts = counts.after(&self.counts);
        }
        self.found = found.map(|plan| {
            // The detour proves nothing: a fact that stays true can also prevent an action.
            let stopped = if self.settings.first_plan_only {
                Some(Stopped::FirstPlan)
            } else {
                outer_flow.is_break().then_some(Stopped::Interrupted)
            };
            Found { plan, stopped }
        });
        outer_flow
    }

    /// Returns the answer, given that of the search.
    pub(super) fn answer(
        self,
        answer: Answer,
        observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Answer {
        let own = answer.counts().copied().unwrap_or_default();
        let counts = own.after(&self.counts);
        match self.found {
            None => with_counts(answer, counts),
            Some(Found {
                plan: found,
                stopped: Some(stopped),
            }) => Answer::Plan {
                found,
                stopped,
                counts,
            },
            Some(Found { plan, .. }) => super::improve_on(
                (self.task, None),
                self.situation,
                self.settings,
                (plan, counts),
                observe,
            ),
        }
    }
}

fn with_counts(mut answer: Answer, new: Counts) -> Answer {
    match &mut answer {
        Answer::Plan { counts, .. }
        | Answer::Unsolvable { counts, .. }
        | Answer::NoneFound { counts, .. } => *counts = new,
        Answer::Unsupported(_) => {}
    }
    answer
}

/// Returns the plan with its values, if it is valid under the original deadlines.
fn in_time(
    task: &Task,
    situation: &Situation,
    settings: &Settings,
    found: &FoundPlan,
) -> Option<FoundPlan> {
    let strictness = validate::Settings::default();
    let Verdict::Valid(report) = validate_from(task, situation, &found.plan, &strictness) else {
        return None;
    };
    Some(FoundPlan::new(
        task,
        settings.objective,
        found.plan.clone(),
        &report,
    ))
}

/// Returns `true` if the timed initial makes a fact false after the situation.
fn may_be_deadline(timed: &TimedInitial, situation: &Situation) -> bool {
    matches!(timed.change, TimedChange::Delete(..)) && timed.time > situation.time
}

/// Returns the task without the timed initials after which a fact stays false.
fn without_last_deadlines(task: &Task, situation: &Situation) -> Task {
    let mut problem = task.problem().clone();
    let mut later = BTreeSet::new();
    // Those of one time stay in the order of the problem.
    problem.timed.sort_by(|a, b| a.time.cmp(&b.time));
    problem.timed.reverse();
    problem.timed.retain(|timed| {
        let is_last = match &timed.change {
            TimedChange::Add(predicate, arguments) | TimedChange::Delete(predicate, arguments) => {
                later.insert((*predicate, arguments.clone()))
            }
            TimedChange::Assign(..) => false,
        };
        !(is_last && may_be_deadline(timed, situation))
    });
    problem.timed.reverse();
    task.extended(problem)
}
