//! Transition from one plan to the next.

use elbowroom_num::Rational;

use super::agenda::{Attempt, FinishedPlan, PendingStep};
use super::plan_start::PlanStart;
use super::settings::{MissingPlan, PlanningTime, RunningRule, Verdict};
use super::situation::OverrunEstimate;
use super::{Run, Stop};
use crate::event::ActionHandle;
use crate::executor::PlanEvent;
use crate::planning::{PlanAnswer, Planned};
use crate::reason::Reason;
use crate::record::Entry;

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
                let lost = self.view().actions_that_cannot_continue();
                self.agenda
                    .push(PendingStep::WaitForRunning(Some(lost.clone())));
                self.agenda.push(PendingStep::Cancel(lost));
            }
            RunningRule::Await => self.agenda.push(PendingStep::WaitForRunning(None)),
            RunningRule::Cancel => {
                self.agenda.push(PendingStep::WaitForRunning(None));
                let running = self.action_log.open_tickets().collect();
                self.agenda.push(PendingStep::Cancel(running));
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
            && !self.goals.is_change_pending()
        {
            self.wait_until_timeout(PendingStep::WaitForActions(tickets, doubts));
        }
    }

    /// Waits until the next time-out or its warning at the latest, and performs `todo` then. If
    /// nothing can time out, nothing is running.
    fn wait_until_timeout(&mut self, todo: PendingStep) {
        let Some(until) = self.view().next_timeout() else {
            return;
        };
        self.agenda.push(todo);
        self.wait_and_check_timeouts(until);
    }

    /// Requests a plan; see [`Run::process_planner_answer`] for its answer.
    pub(super) fn request_awaited_plan(&mut self, reason: &Reason) -> Result<(), Stop> {
        if self.goals.is_change_pending() {
            return Ok(());
        }
        if self.goals.is_paused() {
            self.agenda.push(PendingStep::Plan(reason.clone()));
            self.wait_without_executor();
            return Ok(());
        }
        if let Some(verdict) = self.search_results.failure_at(&self.now) {
            return Err(Stop::Ended(verdict.clone()));
        }
        if self.ask_about_doubts(reason) {
            return Ok(());
        }
        self.stop_if_goal_is_in_doubt()?;
        if self.plans_in_background() {
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
            foreseen.unwrap_or_else(|| self.view().situation_after_planning(guess));
        if self
            .background
            .is_planned_for(&self.task, &situation, guess)
        {
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
            PlanningTime::Measured if self.settings.plans_in_background => Rational::ZERO,
            PlanningTime::Measured => planned.seconds.unwrap_or_default(),
        };
        self.background.update_expected_time(&took);
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
        let goals = self.goals.open();
        self.goals.note_shortfall(&goals, &planned.shortfall);
        self.check_stop_request()?;
        if attempt.is_optional {
            match planned.answer {
                PlanAnswer::Plan(plan) => self.prepare_better_plan(attempt, plan),
                answer => self.search_results.note_no_better_plan(&answer),
            }
            return Ok(());
        }
        let plan = match planned.answer {
            PlanAnswer::Plan(_) if attempt.guess == OverrunEstimate::Cancelled => {
                self.cancel_overdue(attempt.reason);
                return Ok(());
            }
            PlanAnswer::Plan(plan) => {
                let (situation, guess) = (&attempt.situation, attempt.guess);
                self.background
                    .note_planned_for(&self.task, situation, guess);
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
        self.drop_steps();
        self.agenda.push(PendingStep::Adopt(Box::new(FinishedPlan {
            course: (plan, attempt.situation, attempt.running),
            ready,
        })));
        Ok(())
    }

    /// Returns the next attempt after no plan was found with this guess about overdue actions.
    pub(super) fn next_attempt(&self, guess: OverrunEstimate) -> NextAttempt {
        if !self.settings.monitors_slack || self.view().overdue().is_empty() {
            return NextAttempt::ContinuePlan;
        }
        match guess {
            // Overdue actions may still end in time.
            OverrunEstimate::QuarterLonger => NextAttempt::Guess(OverrunEstimate::AsSoonAsPossible),
            // They are only cancelled if there is a plan without them: another goal may be the one
            // that cannot be reached.
            OverrunEstimate::AsSoonAsPossible
                if self.may_carry_on() || self.goals.open().open.len() > 1 =>
            {
                NextAttempt::Guess(OverrunEstimate::Cancelled)
            }
            OverrunEstimate::AsSoonAsPossible => NextAttempt::CancelOverdue,
            OverrunEstimate::Cancelled => NextAttempt::ContinuePlan,
        }
    }

    /// Cancels the overdue actions, which count as failed then, and requests a plan.
    pub(super) fn cancel_overdue(&mut self, reason: Reason) {
        let overdue = self.view().overdue();
        self.agenda.push(PendingStep::Plan(reason));
        self.agenda
            .push(PendingStep::WaitForRunning(Some(overdue.clone())));
        self.agenda.push(PendingStep::Cancel(overdue));
    }

    /// Adopts a plan when its planning time has passed.
    pub(super) fn adopt(&mut self, made: Box<FinishedPlan>) {
        if self.goals.is_change_pending() {
            // It was made for other goals.
            return;
        }
        if self.now < made.ready {
            let ready = made.ready.clone();
            self.agenda.push(PendingStep::Adopt(made));
            self.agenda.push(PendingStep::Wait(ready));
            return;
        }
        let surprises = std::mem::take(&mut self.plan_events);
        self.agenda.push(PendingStep::ReportNews(surprises));
        self.adopt_plan(PlanStart::of(&made.course));
    }

    /// Returns `true` if the executor could continue with the plan that it abandoned.
    pub(super) fn may_carry_on(&self) -> bool {
        self.search_results.has_abandoned_plan()
            && !self.goals.is_change_pending()
            && self.ports.executor.may_carry_on()
    }

    /// Ends the run, because there is no other plan, unless the executor continues with the plan
    /// that it abandoned.
    pub(super) fn continue_abandoned_plan_or_stop(&mut self, verdict: Verdict) -> Result<(), Stop> {
        let abandoned = self.search_results.take_abandoned();
        let Some(abandoned) = abandoned.filter(|_| !self.goals.is_change_pending()) else {
            return Err(Stop::Ended(verdict));
        };
        if !self.ports.executor.carry_on(&self.now) {
            return Err(Stop::Ended(verdict));
        }
        self.ports.recorder.record(&Entry::Kept {
            now: &self.now,
            reason: &abandoned.reason,
        });
        let (missed, plan) = abandoned.resume(&self.action_log);
        self.action_log.resume_plan(plan);
        self.search_results.continue_abandoned(&self.now, verdict);
        let is_of_a_step =
            |it: &PlanEvent| matches!(it, PlanEvent::Started { .. } | PlanEvent::Ended { .. });
        self.plan_events.retain(|it| !is_of_a_step(it));
        self.plan_events.splice(0..0, missed);
        Ok(())
    }

    /// Waits before a plan is requested, if the same action would only be refused again. Returns
    /// `true` if it waits.
    pub(super) fn wait_after_refusal(&mut self, reason: &Reason) -> bool {
        let until = self.refusal_backoff.until.clone();
        if !self.settings.plans_in_background || self.now >= until || self.goals.is_change_pending()
        {
            return false;
        }
        self.agenda.push(PendingStep::Replan(reason.clone()));
        let timeout = self.view().next_timeout();
        self.wait_and_check_timeouts(timeout.map_or(until.clone(), |timeout| timeout.min(until)));
        true
    }
}
