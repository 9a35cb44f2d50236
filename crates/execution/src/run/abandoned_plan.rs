//! Continuation of the present plan if no other one was found.

use std::collections::BTreeSet;

use super::action_log::PlanLog;
use super::{Run, Stop, Verdict};
use crate::event::ActionHandle;
use crate::executor::PlanEvent;
use crate::reason::Reason;
use crate::record::Entry;

/// State of a plan's actions when the executor abandoned the plan.
#[derive(Clone, Debug)]
pub(super) struct AbandonedPlan {
    reason: Reason,
    plan: PlanLog,
    started: BTreeSet<ActionHandle>,
    ended: BTreeSet<ActionHandle>,
}

impl Run<'_> {
    /// Records that the executor abandons the present plan.
    pub(super) fn note_abandoned(&mut self, reason: &Reason) {
        let plan = self.action_log.plan().clone();
        let tickets = || plan.steps.values().copied();
        let has_started = |it: &ActionHandle| {
            let entry = self.action_log.get(*it);
            entry.is_some_and(|entry| entry.started.is_some())
        };
        let has_ended = |it: &ActionHandle| {
            let entry = self.action_log.get(*it);
            entry.is_some_and(|entry| entry.ended.is_some())
        };
        let (started, ended) = (
            tickets().filter(has_started).collect(),
            tickets().filter(has_ended).collect(),
        );
        self.search_results.abandoned = Some(AbandonedPlan {
            reason: reason.clone(),
            plan,
            started,
            ended,
        });
    }

    /// Returns `true` if the executor could continue with the plan that it abandoned.
    pub(super) fn may_carry_on(&self) -> bool {
        self.search_results.abandoned.is_some()
            && !self.is_goal_change_pending()
            && self.ports.executor.may_carry_on()
    }

    /// Ends the run, because there is no other plan, unless the executor continues with the plan
    /// that it abandoned.
    pub(super) fn continue_abandoned_plan_or_stop(&mut self, verdict: Verdict) -> Result<(), Stop> {
        let abandoned = self.search_results.abandoned.take();
        let Some(abandoned) = abandoned.filter(|_| !self.is_goal_change_pending()) else {
            return Err(Stop::Ended(verdict));
        };
        if !self.ports.executor.carry_on(&self.now) {
            return Err(Stop::Ended(verdict));
        }
        self.ports.recorder.record(&Entry::Kept {
            now: &self.now,
            reason: &abandoned.reason,
        });
        let mut missed = Vec::new();
        for (&step, &ticket) in &abandoned.plan.steps {
            if !abandoned.started.contains(&ticket) {
                missed.extend(self.start_event(step, ticket));
            }
            if !abandoned.ended.contains(&ticket) {
                missed.extend(self.end_event(step, ticket));
            }
        }
        missed.sort_by(|(one, _), (other, _)| one.cmp(other));
        self.action_log.resume_plan(abandoned.plan);
        self.search_results.is_plan_infeasible = false;
        self.search_results.failed_at = Some((self.now.clone(), verdict));
        let is_of_a_step =
            |it: &PlanEvent| matches!(it, PlanEvent::Started { .. } | PlanEvent::Ended { .. });
        self.plan_events.retain(|it| !is_of_a_step(it));
        self.plan_events
            .splice(0..0, missed.into_iter().map(|(_, news)| news));
        Ok(())
    }
}
