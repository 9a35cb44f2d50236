//! Continuation of the present plan if no other one was found.

use std::collections::BTreeSet;

use super::account::PlanAccount;
use super::{Run, Stop, Verdict};
use crate::event::Ticket;
use crate::executor::News;
use crate::reason::Reason;
use crate::record::Entry;

/// State of a plan's actions when the executor abandoned the plan.
#[derive(Clone, Debug)]
pub(super) struct Abandoned {
    reason: Reason,
    plan: PlanAccount,
    started: BTreeSet<Ticket>,
    ended: BTreeSet<Ticket>,
}

impl Run<'_> {
    /// Records that the executor abandons the present plan.
    pub(super) fn note_abandoned(&mut self, reason: &Reason) {
        let plan = self.account.plan().clone();
        let tickets = || plan.steps.values().copied();
        let has_started = |it: &Ticket| {
            let entry = self.account.get(*it);
            entry.is_some_and(|entry| entry.started.is_some())
        };
        let has_ended = |it: &Ticket| {
            let entry = self.account.get(*it);
            entry.is_some_and(|entry| entry.ended.is_some())
        };
        let (started, ended) = (
            tickets().filter(has_started).collect(),
            tickets().filter(has_ended).collect(),
        );
        self.lost.abandoned = Some(Abandoned {
            reason: reason.clone(),
            plan,
            started,
            ended,
        });
    }

    /// Returns `true` if the executor could continue with the plan that it abandoned.
    pub(super) fn may_carry_on(&self) -> bool {
        self.lost.abandoned.is_some() && !self.is_to_turn() && self.ports.executor.may_carry_on()
    }

    /// Ends the run, because there is no other plan, unless the executor continues with the plan
    /// that it abandoned.
    pub(super) fn carry_on_or_stop(&mut self, verdict: Verdict) -> Result<(), Stop> {
        let abandoned = self.lost.abandoned.take();
        let Some(abandoned) = abandoned.filter(|_| !self.is_to_turn()) else {
            return Err(Stop::Over(verdict));
        };
        if !self.ports.executor.carry_on(&self.now) {
            return Err(Stop::Over(verdict));
        }
        self.ports.recorder.record(&Entry::Kept {
            now: &self.now,
            reason: &abandoned.reason,
        });
        let mut missed = Vec::new();
        for (&step, &ticket) in &abandoned.plan.steps {
            if !abandoned.started.contains(&ticket) {
                missed.extend(self.beginning(step, ticket));
            }
            if !abandoned.ended.contains(&ticket) {
                missed.extend(self.ending(step, ticket));
            }
        }
        missed.sort_by(|(one, _), (other, _)| one.cmp(other));
        self.account.resume_plan(abandoned.plan);
        self.lost.plan = false;
        self.lost.in_vain = Some((self.now.clone(), verdict));
        let is_of_a_step = |it: &News| matches!(it, News::Started { .. } | News::Ended { .. });
        self.news.retain(|it| !is_of_a_step(it));
        self.news
            .splice(0..0, missed.into_iter().map(|(_, news)| news));
        Ok(())
    }
}
