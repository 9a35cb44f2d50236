//! Executives: runs that continue after their goal is reached, with goals, facts and pauses from
//! outside.
//!
//! Each request arrives as an observation ([`Event::Requested`]). So it is recorded with everything
//! else, and replays and resumed runs receive it again.
//!
//! | request or observation | result |
//! | --- | --- |
//! | a goal | the goal is now the conjunction of all open goals, except those that are set aside. If the remaining plan, started now, reaches it, the plan is kept; otherwise a new plan is made |
//! | a goal with the name of an open one | it replaces the earlier goal; a new plan is made |
//! | a goal with a release time in the future | it is queued until then, and then handled like a new goal |
//! | a goal to keep | it is pursued whenever it does not hold and no other goal is |
//! | a goal is abandoned | a plan is made for the others; without others, nothing more is started |
//! | a fact or value | believed; the plan continues if it is still feasible, otherwise a new one is made |
//! | an action is cancelled | the world receives the cancellation; its end is an outcome like any other |
//! | a pause | nothing is started or planned any more. Running actions continue and are monitored, and silent ones time out. Time passes, also for deadlines |
//! | the end of a pause | the plan continues if it is still feasible, otherwise a new one is made |
//!
//! Actions keep running in all of these cases: they are part of the situation from which the next
//! plan starts ([`RunningRule`](super::RunningRule)).
//!
//! Other runs end when the goals are reached, no plan reaches them, none was found, or the limit on
//! new plans is reached. An executive becomes *idle* instead ([`Entry::Resting`]): it starts
//! nothing, and records the reason. Running actions continue to their ends. A request ends the idle
//! state. While goals are open, so do news from the world and each timed initial, at most once in
//! [`SEARCH_PAUSE`] seconds.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_num::Rational;

use super::agenda::PreparationFallback;
use super::goals::PendingGoalChange;
use super::plan_start::PlanStart;
use super::replans::Replans;
use super::search_results::SearchResults;
use super::settings::Verdict;
use super::{Run, Stop};
use crate::event::{ActionHandle, Request};
use crate::executor::PlanEvent;
use crate::reason::{Cause, Reason, Subject};
use crate::record::{Entry, UnreachedGoal};

/// Time after an unsuccessful search during which no other one begins, whatever is reported, in
/// seconds of the world's clock.
const SEARCH_PAUSE: i64 = 1;

/// Length of the news during a pause above which repetitions are removed.
const MAX_NEWS: usize = 1000;

impl Run<'_> {
    /// Processes a request. Returns the objection to it, if it is ignored.
    pub(super) fn process_request(&mut self, request: &Request) -> Option<&'static str> {
        if !self.goals.accepts_requests() {
            return Some("this run accepts no requests; the request is ignored");
        }
        match request {
            Request::CancelAction { ticket } => self.cancel_on_request(*ticket),
            request => self.with_goals(|goals, it| goals.process_request(it, request)),
        }
    }

    fn cancel_on_request(&mut self, ticket: ActionHandle) -> Option<&'static str> {
        if !self.action_log.open_tickets().any(|open| open == ticket) {
            return Some("no running action has this ticket");
        }
        self.cancel(vec![ticket]);
        None
    }

    /// Handles pauses, changed goals and the idle state. Returns `true` if the executor is not to
    /// be asked.
    pub(super) fn handle_requests(&mut self) -> Result<bool, Stop> {
        if self.goals.is_paused() {
            remove_repeated_news(&mut self.plan_events);
            self.wait_without_executor();
            return Ok(true);
        }
        if self.goals.is_goal_abandoned() {
            if self.action_log.open_tickets().next().is_none() {
                return Err(Stop::Ended(Verdict::Interrupted));
            }
            self.plan_events.clear();
            self.wait_without_executor();
            return Ok(true);
        }
        if self.background.search().is_none()
            && let Some(change) = self.goals.take_change()
        {
            self.search_results.forget_failure();
            self.replans.reset_count();
            self.handle_goal_change(change)?;
            return Ok(true);
        }
        if self.goals.idle_since().is_none() {
            return Ok(false);
        }
        let has_goals = !self.goals.is_empty();
        if !has_goals && !self.goals.has_conflicting_goals() {
            self.plan_events.clear();
        }
        if self.is_search_due() && !has_goals {
            self.plan_events.clear();
            self.with_goals(super::goals::GoalManager::pursue_kept_goals);
        } else if self.is_search_due() {
            self.with_goals(super::goals::GoalManager::wake);
            let reason = Reason::new(Cause::Surprise).about(Subject::AnyObservation);
            self.replan(&reason)?;
        } else {
            self.rotate_while_idle();
            self.wait_without_executor();
        }
        Ok(true)
    }

    /// Records the timed initials after the first `before` of them as news, if they may make open
    /// goals reachable.
    pub(super) fn record_timed_initials_while_idle(&mut self, before: usize) {
        if !self.goals.awaits_timed_initials() {
            return;
        }
        let past = self.task.timed();
        let past = past.get(before..self.belief.past_timed_initials());
        let changes = past.unwrap_or_default().iter().flat_map(|it| &it.changes);
        self.plan_events.extend(changes.map(PlanEvent::from_change));
    }

    /// Keeps the remaining plan, or makes another one.
    fn handle_goal_change(&mut self, change: PendingGoalChange) -> Result<(), Stop> {
        if self.goals.is_empty() {
            self.drop_plan();
            if !self.goals.note_goal_abandoned() {
                self.become_idle_because(None, &[], &[]);
            }
            return Ok(());
        }
        let prepares_aside = self.settings.prepares_in_background;
        let may_keep = change.are_goals_only_added
            && !(prepares_aside && self.search_results.is_plan_infeasible());
        let plan = self.goals.plan().filter(|_| may_keep);
        let Some(rest) = plan.and_then(|plan| self.view().remaining_plan(plan)) else {
            return self.replan_for_changed_goals(&change);
        };
        if self.plans_in_background() && prepares_aside {
            self.prepare_remaining_plan(change, rest);
            return Ok(());
        }
        let (task, goals) = (Arc::clone(&self.task), self.goals.open());
        let fallback = PreparationFallback::ReplanForGoals(change);
        self.await_preparation(&task, &goals, PlanStart::of(&rest), fallback);
        Ok(())
    }

    /// Makes another plan, because the goals have changed.
    pub(super) fn replan_for_changed_goals(
        &mut self,
        change: &PendingGoalChange,
    ) -> Result<(), Stop> {
        if self.search_while_plan_continues(&change.reason)? {
            return Ok(());
        }
        self.replan(&change.reason)
    }

    /// Drops the plan. Running actions are no longer part of a plan.
    fn drop_plan(&mut self) {
        self.drop_steps();
        self.goals.drop_plan();
    }

    /// Waits without asking the executor.
    pub(super) fn wait_without_executor(&mut self) {
        let timeout = self.view().next_timeout();
        let idle_since = self.goals.idle_since().map(|(since, _)| since);
        let is_waiting = !self.goals.is_paused() && !self.plan_events.is_empty();
        let soon = idle_since.filter(|_| is_waiting);
        let soon = soon.map(|since| since + Rational::from(SEARCH_PAUSE));
        let timed = self.belief.next_timed().cloned();
        let timed = timed.filter(|_| {
            self.goals.awaits_timed_initials() || self.goals.has_watched_goals(&self.now)
        });
        let until = timeout.into_iter().chain(soon).chain(timed).min();
        let until = until.unwrap_or_else(|| self.settings.time_limit.clone());
        self.wait_and_check_timeouts(until);
    }

    /// Returns `true` if it is time to search for a plan again.
    fn is_search_due(&self) -> bool {
        self.goals.idle_since().is_some_and(|(since, _)| {
            !self.plan_events.is_empty() && self.now >= since + Rational::from(SEARCH_PAUSE)
        })
    }

    /// Makes the run idle after the goals were reached, or because they cannot be reached.
    pub(super) fn become_idle(&mut self, verdict: &Verdict) {
        if self.with_goals(|goals, it| goals.select_goals_after(it, verdict)) {
            return;
        }
        self.with_goals(super::goals::GoalManager::announce_goals);
        let mut reasons = self.goals.missed_deadlines();
        let is_explained = reasons.len() == self.goals.pursued_goals();
        let explains = self.history.is_explaining() && !is_explained;
        let is_unsolvable = *verdict == Verdict::Unsolvable;
        let is_certain = is_unsolvable || self.goals.is_any_unreachable();
        let parts = (explains && is_certain).then(|| self.unreachable_parts());
        let parts = parts.flatten();
        let known = parts.as_deref().unwrap_or_default();
        let unreached = self.goals.unreached(&self.task, verdict, known);
        if is_unsolvable && explains {
            reasons.extend(self.dead_end(parts));
        }
        self.drop_plan();
        // The last search need not have been that for a goal that may have a plan.
        let undecided = self.goals.undecided_verdict(&unreached);
        let undecided = undecided.as_ref().filter(|_| is_unsolvable);
        self.become_idle_because(undecided.or(Some(verdict)), &reasons, &unreached);
    }

    fn become_idle_because(
        &mut self,
        verdict: Option<&Verdict>,
        dead_end: &[Reason],
        unreached: &[UnreachedGoal],
    ) {
        let goals = self.with_goals(|goals, it| goals.become_idle(it, verdict));
        self.ports.recorder.record(&Entry::Resting {
            now: &self.now,
            // Without goals, there is no verdict.
            verdict: verdict.filter(|_| !goals.is_empty()),
            goals: &goals,
            dead_end,
            unreached,
        });
        if verdict == Some(&Verdict::GoalReached) {
            // The earlier history is not needed for explanations any more.
            self.history.restart(&self.belief);
        }
        self.plan_events.clear();
        self.replans = Replans::default();
        self.search_results = SearchResults::default();
        self.refusal_backoff.reset();
        self.clock_watchdog.begin_plan();
    }
}

/// Removes repeated news of the same fact or value, which accumulate in a long pause.
fn remove_repeated_news(news: &mut Vec<PlanEvent>) {
    if news.len() < MAX_NEWS {
        return;
    }
    let (mut facts, mut values) = (BTreeSet::new(), BTreeSet::new());
    news.retain(|it| match it {
        PlanEvent::Fact(fact) => facts.insert(*fact),
        PlanEvent::Value(fluent) => values.insert(*fluent),
        _ => true,
    });
}
