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

use elbowroom_model::{Situation, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::action_log::KnownStart;
use super::goals::OpenGoal;
use super::kept_goals::Wait;
use super::plan_start::PlanStart;
use super::work_queue::PendingStep;
use super::{RefusalBackoff, Run, Verdict};
use crate::belief_state::BeliefState;
use crate::event::{ActionHandle, GoalTerms};
use crate::executor::PlanEvent;

/// Snapshot of an executive that adopts a plan, or is idle with no action running.
#[derive(Clone, Debug)]
pub struct RunSnapshot {
    /// The belief, at the present time.
    pub belief: BeliefState,
    /// Number of actions started, which is the next ticket.
    pub started: usize,
    /// The running actions, and the last ones that have ended. All other starts ended long ago.
    pub starts: Vec<KnownStart>,
    /// Expected planning time, in seconds of the world's clock.
    pub allowance: Rational,
    /// The time from when answers of the world are counted, and their number, to detect a clock
    /// that stands still ([`Verdict::WorldFailed`]).
    pub answers: (Rational, usize),
    /// Number of new plans since the run was last idle.
    pub replans: usize,
    /// Actions refused by the world since the last other event.
    pub refusals: RefusalBackoff,
    /// The open goals.
    pub goals: Goals,
    /// The goals whose release times have not come, and the goals to keep that are not pursued.
    pub queued: Vec<GivenGoal>,
    /// `true` if the run is paused.
    pub is_paused: bool,
    /// The state of the run.
    pub phase: RunPhase,
}

/// State of a run at a snapshot.
#[derive(Clone, Debug)]
pub enum RunPhase {
    /// It is idle.
    Idle {
        /// Start of the idle state.
        since: Rational,
        /// `true` if it is proved that no plan reaches the open goals from there.
        is_unsolvable: bool,
    },
    /// It adopts a plan.
    Adopting(Box<PlanAdoption>),
}

/// A plan that is being adopted.
#[derive(Clone, Debug)]
pub struct PlanAdoption {
    /// The plan, on the world's clock.
    pub plan: TimeTriggeredPlan,
    /// The situation from which the plan starts.
    pub situation: Situation,
    /// The tickets of the actions that are running there, in its order.
    pub running: Vec<ActionHandle>,
    /// The steps of the plan that have begun since.
    pub begun_steps: Vec<ActionHandle>,
    /// The goals of the plan.
    pub goals: Goals,
    /// Events that the plan does not account for.
    pub plan_events: Vec<PlanEvent>,
    /// The change of the goals since the plan was requested, in words, and `true` if goals were
    /// only added. `None` if they have not changed.
    pub pending_goal_change: Option<(String, bool)>,
}

/// Open goals, as they were given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Goals {
    /// The goals in the order of their requests.
    pub open: Vec<GivenGoal>,
    /// `true` if they are not, or no longer, those of the problem.
    pub are_changed: bool,
}

/// A goal as it was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenGoal {
    /// Its name.
    pub name: String,
    /// Its text in PDDL; `None` for the goal of the problem.
    pub text: Option<String>,
    /// Its value, its times and its author.
    pub terms: GoalTerms,
    /// The reason for which it is set aside while others are pursued; `None` if it is pursued.
    pub set_aside: Option<String>,
    /// Lateness in words, if its deadline is known to be missed.
    pub missed_deadline: Option<String>,
    /// The reason for which it is queued, if it is.
    pub wait: Wait,
}

impl GivenGoal {
    pub(super) fn of(goal: &OpenGoal) -> Self {
        Self {
            name: goal.name.clone(),
            text: goal.text.clone(),
            terms: goal.terms.clone(),
            set_aside: goal.set_aside.clone(),
            missed_deadline: goal.missed_deadline.clone(),
            wait: goal.wait,
        }
    }
}

impl Run<'_> {
    /// Forgets the distant past before a plan is adopted, and lets the recorder rotate.
    pub(super) fn rotate_before_adoption(&mut self, course: PlanStart<'_>, goals: &Goals) {
        if !self.becomes_idle_after(&Verdict::GoalReached) {
            return;
        }
        self.anticipated_replan = None;
        let PlanStart {
            plan,
            situation,
            running,
            begun_steps: begun,
        } = course;
        self.action_log.mark_past(&[running, begun].concat());
        // The agenda is processed from its end, and each item is inserted before the earlier ones.
        let news = self.work_queue.iter().map(|todo| match todo {
            PendingStep::ReportNews(news) => Some(news.as_slice()),
            _ => None,
        });
        let Some(news) = news.collect::<Option<Vec<_>>>() else {
            return;
        };
        let news: Vec<PlanEvent> = news.into_iter().flatten().cloned().collect();
        let is_of_a_step = |it: &PlanEvent| {
            matches!(
                it,
                PlanEvent::Started { .. } | PlanEvent::Ended { .. } | PlanEvent::TimedOut { .. }
            )
        };
        let is_whole = self.search.is_none()
            && !self.is_selecting_goals()
            && self.idle_since_and_proof().is_none()
            && *self.belief.time() == self.now
            && !news.iter().any(is_of_a_step);
        if !is_whole {
            return;
        }
        let turn = self.describe_goal_change();
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
        if self.has_no_goals() {
            self.action_log.close(&self.now);
            self.history.clear();
            self.initial_belief = self.belief.clone();
        } else {
            self.action_log.mark_past(&[]);
        }
        self.anticipated_replan = None;
        self.steps = 0;
        self.offer_rotation(&|| RunPhase::Idle {
            since: since.clone(),
            is_unsolvable,
        });
    }

    /// Lets the recorder rotate. After a rotation, the report and explanations go back no further
    /// than the record.
    fn offer_rotation(&mut self, doing: &dyn Fn() -> RunPhase) {
        let (goals, queued, is_paused) = (self.goals(), self.queued_goals(), self.is_paused());
        let (belief, account, progress) = (&self.belief, &self.action_log, &self.clock_watchdog);
        let (allowance, replans) = (&self.expected_planning_time, self.replans);
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
            self.history.clear();
            self.initial_belief = self.belief.clone();
            self.reasons.clear();
        }
    }

    /// Returns the time since when the run is idle, if no action is running and there is nothing to
    /// do.
    fn idle_since(&self) -> Option<(Rational, bool)> {
        let is_idle = self.becomes_idle_after(&Verdict::GoalReached)
            && self.search.is_none()
            && !self.is_goal_change_pending()
            && self.plan_events.is_empty()
            && self.action_log.open_tickets().next().is_none()
            && self.belief.running().is_empty()
            && self.work_queue.is_empty()
            && *self.belief.time() == self.now;
        let (since, is_unsolvable) = self.idle_since_and_proof().filter(|_| is_idle)?;
        Some((since.clone(), is_unsolvable))
    }

    /// Restores the state of another run from a snapshot. To be called after [`Run::lasting`];
    /// otherwise it has no effect.
    #[must_use]
    pub fn standing(mut self, stand: RunSnapshot) -> Self {
        if !self.becomes_idle_after(&Verdict::GoalReached) {
            return self;
        }
        self.work_queue.clear();
        self.now.clone_from(stand.belief.time());
        let problem = Arc::clone(&self.task);
        self.belief = stand.belief;
        self.belief.set_goal(&problem);
        self.restore_goals(&problem, &stand.goals, &stand.queued, stand.is_paused);
        self.initial_belief = self.belief.clone();
        self.action_log.restore(stand.started, stand.starts);
        self.expected_planning_time = stand.allowance;
        let (since, answers) = stand.answers;
        self.clock_watchdog.restore(since, answers);
        self.replans = stand.replans;
        self.refusal_backoff = stand.refusals;
        match stand.phase {
            RunPhase::Idle {
                since,
                is_unsolvable,
            } => self.set_idle_since(since, is_unsolvable),
            RunPhase::Adopting(takes_up) => {
                let task = self.task_with_goals(&problem, &takes_up.goals);
                self.restore_goal_change(takes_up.pending_goal_change.clone());
                self.work_queue
                    .push(PendingStep::RestoreAdoption(task, takes_up));
            }
        }
        self
    }
}
