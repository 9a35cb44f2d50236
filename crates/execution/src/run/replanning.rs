//! Transition from one plan to the next.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;

use super::plan_start::PlanStart;
use super::situation::{OverrunEstimate, situation_at};
use super::work_queue::{FinishedPlan, PendingStep};
use super::{MissingPlan, PlanningTime, Run, RunningRule, Stop, Verdict};
use crate::event::ActionHandle;
use crate::planning::{PlanAnswer, Planned};
use crate::reason::Reason;
use crate::record::Entry;

/// Request for a plan for which the run waits.
pub(super) struct Attempt {
    pub(super) reason: Reason,
    pub(super) guess: OverrunEstimate,
    pub(super) situation: Situation,
    pub(super) running: Vec<ActionHandle>,
    /// `true` if the present plan continues unless the new one is better.
    pub(super) is_optional: bool,
}

/// The next attempt after no plan was found.
pub(super) enum NextAttempt {
    /// A plan with this guess about overdue actions.
    Guess(OverrunEstimate),
    /// A plan without the overdue actions.
    CancelOverdue,
    /// The present plan.
    ContinuePlan,
}

impl Run<'_> {
    /// Brings the running actions to a state that permits a new plan: see [`RunningRule`].
    pub(super) fn settle_running_actions(&mut self) {
        match self.settings.running {
            RunningRule::Keep => {
                let lost = self.actions_that_cannot_continue();
                self.work_queue
                    .push(PendingStep::WaitForRunning(Some(lost.clone())));
                self.work_queue.push(PendingStep::Cancel(lost));
            }
            RunningRule::Await => self.work_queue.push(PendingStep::WaitForRunning(None)),
            RunningRule::Cancel => {
                self.work_queue.push(PendingStep::WaitForRunning(None));
                let running = self.action_log.open_tickets().collect();
                self.work_queue.push(PendingStep::Cancel(running));
            }
        }
    }

    /// Waits for the actions in `awaited` that have not ended. Each wait ends at a warning or a
    /// time-out at the latest.
    pub(super) fn continue_settling(&mut self, awaited: Option<Vec<ActionHandle>>) {
        if let Some(lost) = &awaited {
            // It counts as running until it has stopped.
            let mut lost = lost.iter();
            if !lost.any(|ticket| self.belief.running().contains_key(ticket)) {
                return;
            }
        }
        self.wait_until_timeout(PendingStep::WaitForRunning(awaited));
    }

    /// Waits for these actions, although a plan could be requested without their ends. The wait
    /// ends early if the goals change, or if doubts are settled or arise.
    pub(super) fn wait_for_actions(&mut self, tickets: Vec<ActionHandle>, doubts: usize) {
        let mut running = tickets.iter();
        if running.any(|ticket| self.belief.running().contains_key(ticket))
            && self.belief.doubt_count() == doubts
            && !self.is_goal_change_pending()
        {
            self.wait_until_timeout(PendingStep::WaitForActions(tickets, doubts));
        }
    }

    /// Waits until the next time-out or its warning at the latest, and performs `todo` then. If
    /// nothing can time out, nothing is running.
    fn wait_until_timeout(&mut self, todo: PendingStep) {
        let Some(until) = self.next_timeout() else {
            return;
        };
        self.work_queue.push(todo);
        self.work_queue.push(PendingStep::CheckTimeouts);
        let until = until.max(self.now.clone());
        self.work_queue.push(PendingStep::Wait(until));
    }

    /// Returns the actions that no plan can continue: those that have not started, and those whose
    /// over-all condition fails.
    fn actions_that_cannot_continue(&self) -> Vec<ActionHandle> {
        let breaking = self.belief.failing_actions().into_iter();
        let breaking: BTreeSet<ActionHandle> = breaking.map(|(ticket, _)| ticket).collect();
        let is_lost = |ticket: &ActionHandle| match self.belief.running().get(ticket) {
            Some(underway) => {
                breaking.contains(ticket) || !underway.violated_conjuncts().is_empty()
            }
            None => true,
        };
        self.action_log.open_tickets().filter(is_lost).collect()
    }

    /// Requests a plan; see [`Run::take_plan`] for its answer.
    pub(super) fn request_awaited_plan(&mut self, reason: &Reason) -> Result<(), Stop> {
        if self.is_goal_change_pending() {
            return Ok(());
        }
        if self.is_paused() {
            self.work_queue.push(PendingStep::Plan(reason.clone()));
            self.wait_without_executor();
            return Ok(());
        }
        if let Some((time, verdict)) = &self.search_results.failed_at
            && *time == self.now
        {
            return Err(Stop::Ended(verdict.clone()));
        }
        if self.ask_about_doubts(reason) {
            return Ok(());
        }
        self.stop_if_goal_is_in_doubt()?;
        if self.plans_aside() {
            self.search_from_here(reason);
            return Ok(());
        }
        self.plan_events.clear();
        if self.finish_if_goal_holds(reason) {
            return Ok(());
        }
        self.request_plan_with_estimate(reason, OverrunEstimate::QuarterLonger)
    }

    /// Requests a plan, for which the run waits.
    fn request_plan_with_estimate(
        &mut self,
        reason: &Reason,
        guess: OverrunEstimate,
    ) -> Result<(), Stop> {
        let foreseen = self.anticipated_situation(guess);
        let foreseen = foreseen.map(|it| (it.prospect.situation, it.prospect.running));
        let (situation, running) =
            foreseen.unwrap_or_else(|| self.situation(&self.expected_planning_time, guess));
        let is_known = |(task, known, before): &(Arc<Task>, Situation, OverrunEstimate)| {
            Arc::ptr_eq(task, &self.task) && *known == situation && *before == guess
        };
        if self.planned_for.as_ref().is_some_and(is_known) {
            let why = format!("the executor rejects the plan that exists: {reason}");
            let missing = MissingPlan::Rejected;
            return self.continue_abandoned_plan_or_stop(Verdict::NoPlan { why, missing });
        }
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason,
            situation: &situation,
        });
        self.await_plan(Attempt {
            reason: reason.clone(),
            guess,
            situation,
            running,
            is_optional: false,
        });
        Ok(())
    }

    /// Processes the answer to an awaited request. The plan is adopted when its planning time has
    /// passed.
    pub(super) fn process_planner_answer(
        &mut self,
        attempt: Attempt,
        planned: Planned,
    ) -> Result<(), Stop> {
        let took = match &self.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            // The world's clock starts when there is a first plan.
            PlanningTime::Measured if self.settings.plans_aside => Rational::ZERO,
            PlanningTime::Measured => planned.seconds.unwrap_or_default(),
        };
        self.update_expected_planning_time(&took);
        let ready = &self.now + &took;
        self.ports.recorder.record(&Entry::Planned {
            now: &ready,
            took: &took,
            plan: planned.answer.plan(),
            why_not: planned.answer.failure_reason(),
            is_unsolvable: planned.answer == PlanAnswer::Unsolvable,
            has_failed: matches!(planned.answer, PlanAnswer::Failed { .. }),
            remark: planned.remark.as_deref(),
            shortfall: &planned.shortfall,
        });
        self.note_shortfall(&self.goals(), &planned.shortfall);
        self.check_stop_request()?;
        if attempt.is_optional {
            match planned.answer {
                PlanAnswer::Plan(plan) => self.prepare_better_plan(attempt, &plan),
                answer => self.note_no_better_plan(&answer),
            }
            return Ok(());
        }
        let plan = match planned.answer {
            PlanAnswer::Plan(_) if attempt.guess == OverrunEstimate::Cancelled => {
                self.cancel_overdue(attempt.reason);
                return Ok(());
            }
            PlanAnswer::Plan(plan) => {
                let task = Arc::clone(&self.task);
                self.planned_for = Some((task, attempt.situation.clone(), attempt.guess));
                plan
            }
            answer => {
                let next = self.next_attempt(attempt.guess);
                return match next {
                    NextAttempt::Guess(guess) => {
                        self.request_plan_with_estimate(&attempt.reason, guess)
                    }
                    NextAttempt::CancelOverdue => {
                        self.cancel_overdue(attempt.reason);
                        Ok(())
                    }
                    NextAttempt::ContinuePlan => {
                        self.continue_or_stop_without_plan(&answer, attempt.reason)
                    }
                };
            }
        };
        // Actions that end before the adoption belong to neither plan. Their effects are news, and
        // the new plan receives their ends.
        self.action_log.begin_plan(&BTreeMap::new());
        self.work_queue
            .push(PendingStep::Adopt(Box::new(FinishedPlan {
                plan,
                situation: attempt.situation,
                running: attempt.running,
                ready,
            })));
        Ok(())
    }

    /// Returns the next attempt after no plan was found with this guess about overdue actions.
    pub(super) fn next_attempt(&self, guess: OverrunEstimate) -> NextAttempt {
        if !self.settings.monitors_slack || self.overdue().is_empty() {
            return NextAttempt::ContinuePlan;
        }
        match guess {
            // Overdue actions may still end in time.
            OverrunEstimate::QuarterLonger => NextAttempt::Guess(OverrunEstimate::AsSoonAsPossible),
            // They are only cancelled if there is a plan without them.
            OverrunEstimate::AsSoonAsPossible if self.may_carry_on() => {
                NextAttempt::Guess(OverrunEstimate::Cancelled)
            }
            OverrunEstimate::AsSoonAsPossible => NextAttempt::CancelOverdue,
            OverrunEstimate::Cancelled => NextAttempt::ContinuePlan,
        }
    }

    /// Cancels the overdue actions, which count as failed then, and requests a plan.
    pub(super) fn cancel_overdue(&mut self, reason: Reason) {
        let overdue = self.overdue();
        self.work_queue.push(PendingStep::Plan(reason));
        self.work_queue
            .push(PendingStep::WaitForRunning(Some(overdue.clone())));
        self.work_queue.push(PendingStep::Cancel(overdue));
    }

    /// Updates the expected planning time: to the last planning time if that is greater, otherwise
    /// to no less than half of the previous value. If one long search delayed all later plans, a
    /// run with frequent new goals would never start anything.
    pub(super) fn update_expected_planning_time(&mut self, took: &Rational) {
        let half = &self.expected_planning_time / &Rational::from(2);
        self.expected_planning_time = half.max(took.clone());
    }

    /// Adopts a plan when its planning time has passed.
    pub(super) fn adopt(&mut self, made: Box<FinishedPlan>) {
        if self.is_goal_change_pending() {
            // It was made for other goals.
            return;
        }
        if self.now < made.ready {
            let ready = made.ready.clone();
            self.work_queue.push(PendingStep::Adopt(made));
            self.work_queue.push(PendingStep::Wait(ready));
            return;
        }
        let surprises = std::mem::take(&mut self.plan_events);
        self.work_queue.push(PendingStep::ReportNews(surprises));
        self.adopt_plan(PlanStart::of(&made.plan, &made.situation, &made.running));
    }

    /// Returns the situation when the new plan can start: after the expected planning time, and ε
    /// after the last event before that.
    pub(super) fn situation(
        &self,
        allowance: &Rational,
        guess: OverrunEstimate,
    ) -> (Situation, Vec<ActionHandle>) {
        let epsilon = self.task.epsilon();
        let mut time = &self.now + allowance;
        // With other goals, the problem is a different one, and is written again for planners that
        // read files.
        if self.now.is_positive() || self.action_log.started() > 0 || self.have_goals_changed() {
            time += epsilon;
        }
        if time.is_zero() {
            return (Situation::initial(&self.task), Vec::new());
        }
        self.situation_at(time, guess)
    }

    /// Returns the situation at this time, or ε after the timed initials that come just before it.
    pub(super) fn situation_at(
        &self,
        time: Rational,
        guess: OverrunEstimate,
    ) -> (Situation, Vec<ActionHandle>) {
        if guess != OverrunEstimate::Cancelled {
            return situation_at(&self.belief, time, guess);
        }
        let mut belief = self.belief.clone();
        for ticket in self.overdue() {
            belief.stop(ticket);
        }
        situation_at(&belief, time, guess)
    }
}
