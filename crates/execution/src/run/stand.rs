//! Snapshots of an executive, from which it can be resumed. Its record can be rotated there:
//! earlier entries are not needed.
//!
//! There are two kinds of such moments. When a plan is adopted, the executor forgets the earlier
//! one, and its further state follows from the plan and the belief. When the run is idle and no
//! action is running, there is no plan. A run that is restored from a [`Stand`] makes the same
//! decisions as this one. To keep the snapshot small, the run forgets part of its past at these
//! moments, whether or not its record is rotated: late reports on actions that ended long ago are
//! ignored from then on. Only the texts of explanations and reports depend on the length of the
//! record.

use std::sync::Arc;

use elbowroom_model::{Situation, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::account::KnownStart;
use super::agenda::Todo;
use super::beginning::Course;
use super::goals::OpenGoal;
use super::{Refusals, Run, Verdict};
use crate::event::{GoalTerms, Ticket};
use crate::executor::News;
use crate::progression::Progression;

/// Snapshot of an executive that adopts a plan, or is idle with no action running.
#[derive(Clone, Debug)]
pub struct Stand {
    /// The belief, at the present time.
    pub belief: Progression,
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
    pub refusals: Refusals,
    /// The open goals.
    pub goals: Goals,
    /// `true` if the run is paused.
    pub is_paused: bool,
    /// The state of the run.
    pub doing: Doing,
}

/// State of a run at a snapshot.
#[derive(Clone, Debug)]
pub enum Doing {
    /// It is idle.
    Rests {
        /// Start of the idle state.
        since: Rational,
        /// `true` if it is proved that no plan reaches the open goals from there.
        is_unsolvable: bool,
    },
    /// It adopts a plan.
    TakesUp(Box<TakesUp>),
}

/// A plan that is being adopted.
#[derive(Clone, Debug)]
pub struct TakesUp {
    /// The plan, on the world's clock.
    pub plan: TimeTriggeredPlan,
    /// The situation from which the plan starts.
    pub situation: Situation,
    /// The tickets of the actions that are running there, in its order.
    pub running: Vec<Ticket>,
    /// The steps of the plan that have begun since.
    pub begun: Vec<Ticket>,
    /// The goals of the plan.
    pub goals: Goals,
    /// Events that the plan does not account for.
    pub news: Vec<News>,
    /// The change of the goals since the plan was requested, in words, and `true` if goals were
    /// only added. `None` if they have not changed.
    pub turn: Option<(String, bool)>,
}

/// Open goals, as they were given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Goals {
    /// The goals in the order of their requests.
    pub open: Vec<GivenGoal>,
    /// `true` if they are not, or no longer, those of the problem.
    pub are_others: bool,
}

/// A goal as it was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenGoal {
    /// Its name.
    pub name: String,
    /// Its text in PDDL; `None` for the goal of the problem.
    pub text: Option<String>,
    /// Its value and its deadline.
    pub terms: GoalTerms,
    /// The reason for which it is set aside while others are pursued; `None` if it is pursued.
    pub aside: Option<String>,
    /// Lateness in words, if its deadline is known to be missed.
    pub late: Option<String>,
}

impl GivenGoal {
    pub(super) fn of(goal: &OpenGoal) -> Self {
        Self {
            name: goal.name.clone(),
            text: goal.text.clone(),
            terms: goal.terms.clone(),
            aside: goal.aside.clone(),
            late: goal.late.clone(),
        }
    }
}

impl Run<'_> {
    /// Forgets the distant past before a plan is adopted, and lets the recorder rotate.
    pub(super) fn begin_anew_with(&mut self, course: Course<'_>, goals: &Goals) {
        if !self.goes_on_after(&Verdict::GoalReached) {
            return;
        }
        self.foreseen = None;
        let Course {
            plan,
            situation,
            running,
            begun,
        } = course;
        self.account.leave_behind(&[running, begun].concat());
        // The agenda is processed from its end, and each item is inserted before the earlier ones.
        let news = self.agenda.iter().map(|todo| match todo {
            Todo::Tell(news) => Some(news.as_slice()),
            _ => None,
        });
        let Some(news) = news.collect::<Option<Vec<_>>>() else {
            return;
        };
        let news: Vec<News> = news.into_iter().flatten().cloned().collect();
        let is_of_a_step = |it: &News| {
            matches!(
                it,
                News::Started { .. } | News::Ended { .. } | News::Silence { .. }
            )
        };
        let is_whole = self.search.is_none()
            && !self.is_choosing_goals()
            && self.rests_since().is_none()
            && *self.belief.time() == self.now
            && !news.iter().any(is_of_a_step);
        if !is_whole {
            return;
        }
        let turn = self.turn_in_words();
        let takes_up = || TakesUp {
            plan: plan.clone(),
            situation: situation.clone(),
            running: running.to_vec(),
            begun: begun.to_vec(),
            goals: goals.clone(),
            news: news.clone(),
            turn: turn.clone(),
        };
        self.ask_to_begin_anew(&|| Doing::TakesUp(Box::new(takes_up())));
    }

    /// Forgets the distant past while the run is idle, and lets the recorder rotate.
    pub(super) fn begin_anew_at_rest(&mut self) {
        let Some((since, is_unsolvable)) = self.idle_since() else {
            return;
        };
        if self.has_no_goals() {
            self.account.close(&self.now);
            self.history.clear();
            self.beginning = self.belief.clone();
        } else {
            self.account.leave_behind(&[]);
        }
        self.foreseen = None;
        self.steps = 0;
        self.ask_to_begin_anew(&|| Doing::Rests {
            since: since.clone(),
            is_unsolvable,
        });
    }

    /// Lets the recorder rotate. After a rotation, the report and explanations go back no further
    /// than the record.
    fn ask_to_begin_anew(&mut self, doing: &dyn Fn() -> Doing) {
        let (goals, is_paused) = (self.goals(), self.is_paused());
        let (belief, account, progress) = (&self.belief, &self.account, &self.progress);
        let (allowance, replans) = (&self.allowance, self.replans);
        let refusals = &self.refusals;
        let is_anew = self.ports.recorder.begin_anew(&|| Stand {
            belief: belief.clone(),
            started: account.started(),
            starts: account.known(),
            allowance: allowance.clone(),
            answers: progress.counted(),
            replans,
            refusals: refusals.clone(),
            goals: goals.clone(),
            is_paused,
            doing: doing(),
        });
        if is_anew {
            self.account.forget_what_is_past();
            self.history.clear();
            self.beginning = self.belief.clone();
            self.reasons.clear();
        }
    }

    /// Returns the time since when the run is idle, if no action is running and there is nothing to
    /// do.
    fn idle_since(&self) -> Option<(Rational, bool)> {
        let is_idle = self.goes_on_after(&Verdict::GoalReached)
            && self.search.is_none()
            && !self.is_to_turn()
            && self.news.is_empty()
            && self.account.open_tickets().next().is_none()
            && self.belief.running().is_empty()
            && self.agenda.is_empty()
            && *self.belief.time() == self.now;
        let (since, is_unsolvable) = self.rests_since().filter(|_| is_idle)?;
        Some((since.clone(), is_unsolvable))
    }

    /// Restores the state of another run from a snapshot. To be called after [`Run::lasting`];
    /// otherwise it has no effect.
    #[must_use]
    pub fn standing(mut self, stand: Stand) -> Self {
        if !self.goes_on_after(&Verdict::GoalReached) {
            return self;
        }
        self.agenda.clear();
        self.now.clone_from(stand.belief.time());
        let problem = Arc::clone(&self.task);
        self.belief = stand.belief;
        self.belief.pursue(&problem);
        self.pursue_again(&problem, &stand.goals, stand.is_paused);
        self.beginning = self.belief.clone();
        self.account.begin_at(stand.started, stand.starts);
        self.allowance = stand.allowance;
        let (since, answers) = stand.answers;
        self.progress.go_on_counting(since, answers);
        self.replans = stand.replans;
        self.refusals = stand.refusals;
        match stand.doing {
            Doing::Rests {
                since,
                is_unsolvable,
            } => self.rest_since(since, is_unsolvable),
            Doing::TakesUp(takes_up) => {
                let task = self.task_of(&problem, &takes_up.goals);
                self.turn_again(takes_up.turn.clone());
                self.agenda.push(Todo::TakeUpAgain(task, takes_up));
            }
        }
        self
    }
}
