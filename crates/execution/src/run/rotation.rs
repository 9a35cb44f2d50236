//! Snapshots of an executive, from which it can be resumed. Its record can be rotated there:
//! earlier entries are not needed.
//!
//! There are two kinds of such moments. When a plan is adopted, the executor forgets the earlier
//! one, and its further state follows from the plan and the belief. When the run is idle and no
//! action is running, there is no plan. A run that is restored from a [`RunSnapshot`] makes the same
//! decisions as this one. To keep the snapshot small, the run forgets part of its past at these
//! moments, whether or not its record is rotated: late reports on actions that ended long ago are
//! ignored from then on. Only the texts of explanations and reports depend on the length of the
//! record.

use std::sync::Arc;

use elbowroom_num::Rational;

use super::Run;
use super::agenda::PendingStep;
use super::goals::Goals;
use super::plan_start::PlanStart;
use super::replans::Replans;
use super::snapshot::{PlanAdoption, RunPhase, RunSnapshot};
use crate::executor::PlanEvent;

impl Run<'_> {
    /// Forgets the distant past before a plan is adopted, and lets the recorder rotate.
    pub(super) fn rotate_before_adoption(&mut self, course: PlanStart<'_>, goals: &Goals) {
        if !self.goals.is_executive() {
            return;
        }
        self.background.take_anticipated();
        let PlanStart {
            plan,
            situation,
            running,
            begun_steps: begun,
        } = course;
        self.action_log.mark_past(&[running, begun].concat());
        let Some(news) = self.agenda.only_news() else {
            return;
        };
        let is_of_a_step = |it: &PlanEvent| {
            matches!(
                it,
                PlanEvent::Started { .. } | PlanEvent::Ended { .. } | PlanEvent::TimedOut { .. }
            )
        };
        let is_whole = self.background.search().is_none()
            && !self.goals.is_selecting_goals()
            && self.goals.idle_since().is_none()
            && *self.belief.time() == self.now
            && !news.iter().any(is_of_a_step);
        if !is_whole {
            return;
        }
        let turn = self.goals.describe_change();
        let takes_up = || PlanAdoption {
            plan: plan.clone(),
            situation: situation.clone(),
            running: running.to_vec(),
            begun_steps: begun.to_vec(),
            goals: goals.clone(),
            plan_events: news.clone(),
            pending_goal_change: turn.clone(),
        };
        self.offer_rotation(&|| RunPhase::Adopting(Box::new(takes_up())));
    }

    /// Forgets the distant past while the run is idle, and lets the recorder rotate.
    pub(super) fn rotate_while_idle(&mut self) {
        let Some((since, is_unsolvable)) = self.idle_since() else {
            return;
        };
        if self.goals.is_empty() {
            self.action_log.close(&self.now);
            self.history.restart(&self.belief);
        } else {
            self.action_log.mark_past(&[]);
        }
        self.background.take_anticipated();
        self.steps = 0;
        self.offer_rotation(&|| RunPhase::Idle {
            since: since.clone(),
            is_unsolvable,
        });
    }

    /// Lets the recorder rotate. After a rotation, the report and explanations go back no further
    /// than the record.
    fn offer_rotation(&mut self, doing: &dyn Fn() -> RunPhase) {
        let (goals, queued, is_paused) = (
            self.goals.open(),
            self.goals.queued(),
            self.goals.is_paused(),
        );
        let (belief, account, progress) = (&self.belief, &self.action_log, &self.clock_watchdog);
        let (allowance, replans) = (self.background.expected_time(), self.replans.count());
        let refusals = &self.refusal_backoff;
        let is_anew = self.ports.recorder.begin_anew(&|| RunSnapshot {
            belief: belief.clone(),
            started: account.started(),
            starts: account.known_starts(),
            allowance: allowance.clone(),
            answers: progress.state(),
            replans,
            refusals: refusals.clone(),
            goals: goals.clone(),
            queued: queued.clone(),
            is_paused,
            phase: doing(),
        });
        if is_anew {
            self.action_log.forget_past_starts();
            self.history.restart(&self.belief);
            self.replans.forget_reasons();
        }
    }

    /// Returns the time since when the run is idle, if no action is running and there is nothing to
    /// do.
    fn idle_since(&self) -> Option<(Rational, bool)> {
        let is_idle = self.goals.is_executive()
            && self.background.search().is_none()
            && !self.goals.is_change_pending()
            && self.plan_events.is_empty()
            && self.action_log.open_tickets().next().is_none()
            && self.belief.running().is_empty()
            && self.agenda.is_empty()
            && *self.belief.time() == self.now;
        let (since, is_unsolvable) = self.goals.idle_since().filter(|_| is_idle)?;
        Some((since.clone(), is_unsolvable))
    }

    /// Restores the state of another run from a snapshot. To be called after [`Run::persistent`];
    /// otherwise it has no effect.
    #[must_use]
    pub fn standing(mut self, stand: RunSnapshot) -> Self {
        if !self.goals.is_executive() {
            return self;
        }
        self.agenda.clear();
        self.now.clone_from(stand.belief.time());
        let problem = Arc::clone(&self.task);
        self.belief = stand.belief;
        self.belief.set_goal(&problem);
        let (goals, is_paused) = ((&stand.goals, &stand.queued[..]), stand.is_paused);
        self.with_goals(|it, context| it.restore(context, &problem, goals, is_paused));
        self.history.restart(&self.belief);
        self.action_log.restore(stand.started, stand.starts);
        self.background.set_expected_time(stand.allowance);
        let (since, answers) = stand.answers;
        self.clock_watchdog.restore(since, answers);
        self.replans = Replans::restored(stand.replans);
        self.refusal_backoff = stand.refusals;
        match stand.phase {
            RunPhase::Idle {
                since,
                is_unsolvable,
            } => self.goals.set_idle_since(since, is_unsolvable),
            RunPhase::Adopting(takes_up) => {
                let chooses_order = self.chooses_order();
                let task = self
                    .goals
                    .task_with(&problem, &takes_up.goals, chooses_order);
                self.goals
                    .restore_change(takes_up.pending_goal_change.clone());
                self.agenda
                    .push(PendingStep::RestoreAdoption(task, takes_up));
            }
        }
        self
    }
}
