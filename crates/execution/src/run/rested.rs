//! Where a lasting run rests, as all that is needed to go on from there.
//!
//! While a run rests without goals and with nothing under way, what was before matters only by what is
//! believed. So it forgets the rest: reports on what had ended count for nothing from then on, and
//! a run that is put together from [`Rested`] decides as this one does, whatever comes.

use std::sync::Arc;

use elbowroom_model::problem;
use elbowroom_num::Rational;

use super::{Run, Verdict};
use crate::progression::Progression;

/// A lasting run at rest, without goals and with nothing under way.
#[derive(Clone, Debug)]
pub struct Rested {
    /// What is believed, at the present time; nothing is running in it.
    pub belief: Progression,
    /// Since when the run rests, by the world's clock.
    pub since: Rational,
    /// How many actions were started: the next ticket.
    pub started: usize,
    /// How long making a plan is expected to take, in seconds of the world's time.
    pub allowance: Rational,
    /// Since when answers of the world are counted, and how many there were: a clock that stands
    /// still is noticed ([`Verdict::WorldFailed`]).
    pub answers: (Rational, usize),
}

impl Run<'_> {
    /// Forgets what was before, if the run rests without goals and nothing is under way, and has the
    /// recorder begin anew if it wants to.
    pub(super) fn begin_anew(&mut self) {
        let Some(since) = self.idle_since() else {
            return;
        };
        self.account.close(&self.now);
        self.history.clear();
        self.beginning = self.belief.clone();
        self.foreseen = None;
        self.steps = 0;
        let (belief, account) = (&self.belief, &self.account);
        let (allowance, progress) = (&self.allowance, &self.progress);
        let is_anew = self.ports.recorder.begin_anew(&|| Rested {
            belief: belief.clone(),
            since: since.clone(),
            started: account.started(),
            allowance: allowance.clone(),
            answers: progress.counted(),
        });
        if is_anew {
            // The report has what the record has.
            self.account.forget_closed();
        }
    }

    /// Since when the run rests, if nothing but its belief matters.
    fn idle_since(&self) -> Option<Rational> {
        let is_idle = self.goes_on_after(&Verdict::GoalReached)
            && self.has_no_goals()
            && self.search.is_none()
            && !self.is_to_turn()
            && self.account.open_tickets().next().is_none()
            && self.belief.running().is_empty()
            && self.agenda.is_empty()
            && *self.belief.time() == self.now;
        self.rests_since().filter(|_| is_idle).cloned()
    }

    /// The same run at rest, where another one has been; to be called once the run is
    /// [lasting](Run::lasting). Nothing is made of it otherwise.
    #[must_use]
    pub fn resting(mut self, rested: Rested) -> Self {
        if !self.goes_on_after(&Verdict::GoalReached) {
            return self;
        }
        self.agenda.clear();
        self.now.clone_from(rested.belief.time());
        self.task = Arc::new(self.task.with_goal(problem::Condition::TRUE));
        self.belief = rested.belief;
        self.belief.pursue(&self.task);
        self.beginning = self.belief.clone();
        self.account.begin_at(rested.started);
        self.allowance = rested.allowance;
        let (since, answers) = rested.answers;
        self.progress.go_on_counting(since, answers);
        self.rest_without_goals(rested.since);
        self
    }
}
