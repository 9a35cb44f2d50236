//! Reasons why the embedded planner has no plan: missed deadlines, and goals that exclude each
//! other.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use elbowroom_execution::{Lateness, PlanAnswer, Shortfall};
use elbowroom_model::ground::Condition;
use elbowroom_model::validate::{Settings, validate_from};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_planner::embedded::{self, Objective};
use elbowroom_planner::no_plan::{Effort, conflict, earliest_times, with_any_ends};

use super::Embedded;

/// Share of the limits of a plan that a search without deadlines may take.
const LIMIT_DIVISOR: u64 = 4;

/// Deadline, in seconds after the situation, of searches without deadlines.
const FAR_DEADLINE: i64 = 1_000_000_000;

impl Embedded<'_> {
    /// Completes an answer without a plan: the reasons, and the proof that a deadline is missed.
    pub(super) fn with_shortfall(
        &self,
        task: &Task,
        situation: &Situation,
        answer: PlanAnswer,
    ) -> (PlanAnswer, Shortfall) {
        let mut shortfall = Shortfall::default();
        let has_none = matches!(answer, PlanAnswer::Unsolvable | PlanAnswer::NotFound { .. });
        if !has_none || self.certificate_work == 0 || !self.may_continue() {
            return (answer, shortfall);
        }
        if answer == PlanAnswer::Unsolvable {
            let any_ends = with_any_ends(situation);
            let may_continue = &mut || self.may_continue();
            shortfall.conflict = conflict(task, &any_ends, self.certificate_work, may_continue);
        }
        if shortfall.conflict.is_empty() {
            shortfall.missed_deadlines = self.missed_deadlines(task, situation);
            let mut late = shortfall.missed_deadlines.iter();
            if late.any(|late| late.proven_lower_bound.is_some()) {
                return (PlanAnswer::Unsolvable, shortfall);
            }
        }
        (answer, shortfall)
    }

    fn may_continue(&self) -> bool {
        self.may_continue.is_none_or(|may_continue| may_continue())
    }

    /// Returns the deadlines that are missed.
    fn missed_deadlines(&self, task: &Task, situation: &Situation) -> Vec<Lateness> {
        let deadlines: Vec<(&Rational, &Condition)> = task.deadlines().collect();
        if deadlines.is_empty() {
            return Vec::new();
        }
        let conditions: Vec<&Condition> = deadlines.iter().map(|it| it.1).collect();
        let may_continue = &mut || self.may_continue();
        let mut effort = Effort::of(self.certificate_work, may_continue);
        let any_ends = with_any_ends(situation);
        let least = earliest_times(task, &any_ends, &conditions, &mut effort);
        let mut least = least.unwrap_or_default().into_iter();
        // A plan for several goals may reach each of them later than necessary.
        let is_alone = deadlines.len() == 1 && task.goal().conjuncts().is_empty();
        let found = is_alone.then(|| self.without_deadlines(task, situation));
        let found = found.flatten();
        let late = deadlines
            .iter()
            .enumerate()
            .map(|(place, (deadline, condition))| {
                let is_late = |time: &Rational| time > deadline;
                let reached = found.as_ref();
                let reached = reached.and_then(|plan| reached_at(task, situation, plan, condition));
                Lateness {
                    deadline_index: place,
                    achieved_at: reached.filter(is_late),
                    proven_lower_bound: least.next().flatten().filter(is_late),
                }
            });
        late.filter(|it| it.achieved_at.is_some() || it.proven_lower_bound.is_some())
            .collect()
    }

    /// Returns the plan with the least makespan that a short search finds without deadlines.
    fn without_deadlines(&self, task: &Task, situation: &Situation) -> Option<TimeTriggeredPlan> {
        let far = &situation.time + Rational::from(FAR_DEADLINE);
        let conditions = task.deadlines().map(|(_, condition)| condition.clone());
        let relaxed = task.with_ground_deadlines(conditions.map(|it| (far.clone(), it)));
        let settings = embedded::Settings {
            objective: Objective::Makespan,
            ..self.settings.clone()
        };
        let (most_states, most_work) =
            (self.most_states / LIMIT_DIVISOR, self.work / LIMIT_DIVISOR);
        let answer = embedded::plan(&relaxed, situation, &settings, &mut |progress| {
            let counts = &progress.counts;
            let limit = match progress.best {
                Some(_) => self.improve_states.min(most_states),
                None => most_states,
            };
            if counts.evaluated >= limit || counts.work >= most_work || !self.may_continue() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        answer.found().map(|found| found.plan.clone())
    }
}

/// Returns the time at which a plan without deadlines first makes a condition true.
fn reached_at(
    task: &Task,
    situation: &Situation,
    plan: &TimeTriggeredPlan,
    condition: &Condition,
) -> Option<Rational> {
    let ends = plan.steps.iter().map(Step::end);
    let starts = plan.steps.iter().map(|step| step.start.clone());
    let initials = task.timed().iter().map(|timed| timed.time.clone());
    let times: BTreeSet<Rational> = starts.chain(ends).chain(initials).collect();
    let times: Vec<Rational> = times
        .into_iter()
        .filter(|it| *it >= situation.time)
        .collect();
    let is_reached_by = |time: &Rational| {
        let deadline = [(time.clone(), condition.clone())];
        let task = task.with_ground_deadlines(deadline);
        validate_from(&task, situation, plan, &Settings::default()).is_valid()
    };
    let place = times.partition_point(|time| !is_reached_by(time));
    times.get(place).cloned()
}
