//! Where a lasting run stands, as all that is needed to go on from there: its record can begin anew
//! there, without what was recorded before.
//!
//! There are two kinds of such moments. When a plan is taken up, the executor forgets the one before,
//! and all that it will know follows from the plan and from what is believed. When the run rests and
//! nothing is under way, there is no plan. A run that is put together from [`Stand`] decides as this
//! one does, whatever comes. For that, a run forgets at these moments what would take too much to
//! write down, whether its record begins anew or not: late reports on what had ended long before count
//! for nothing from then on. Only the words in which things are explained and reported depend on how
//! far the record reaches back.

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

/// A lasting run that takes up a plan, or rests with nothing under way.
#[derive(Clone, Debug)]
pub struct Stand {
    /// What is believed, at the present time.
    pub belief: Progression,
    /// How many actions were started: the next ticket.
    pub started: usize,
    /// Those that are under way, and the last ones that have ended. What else was started has ended long
    /// ago.
    pub starts: Vec<KnownStart>,
    /// How long making a plan is expected to take, in seconds of the world's time.
    pub allowance: Rational,
    /// Since when answers of the world are counted, and how many there were: a clock that stands
    /// still is noticed ([`Verdict::WorldFailed`]).
    pub answers: (Rational, usize),
    /// How many new plans were made since the run last rested.
    pub replans: usize,
    /// What the world has refused since anything else has happened.
    pub refusals: Refusals,
    /// The open goals.
    pub goals: Goals,
    /// Whether nothing is to be started.
    pub is_paused: bool,
    /// What it does.
    pub doing: Doing,
}

/// What a run does where its record can begin anew.
#[derive(Clone, Debug)]
pub enum Doing {
    /// It rests.
    Rests {
        /// Since then.
        since: Rational,
        /// `true` if it is proved that no plan reaches the open goals from there.
        is_unsolvable: bool,
    },
    /// It takes up a plan.
    TakesUp(Box<TakesUp>),
}

/// A plan that is taken up.
#[derive(Clone, Debug)]
pub struct TakesUp {
    /// The plan, on the world's clock.
    pub plan: TimeTriggeredPlan,
    /// From where.
    pub situation: Situation,
    /// The tickets of what is under way there, in its order.
    pub running: Vec<Ticket>,
    /// What of the plan has begun since.
    pub begun: Vec<Ticket>,
    /// The goals that it is for.
    pub goals: Goals,
    /// What it does not know of.
    pub news: Vec<News>,
    /// How the goals have changed since it was asked for, in words, and whether they have only become
    /// more; if they have changed.
    pub turn: Option<(String, bool)>,
}

/// Goals that are open, as they were given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Goals {
    /// The goals in the order of their requests.
    pub open: Vec<GivenGoal>,
    /// Whether they are not, or no longer, those of the problem.
    pub are_others: bool,
}

/// A goal as it was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenGoal {
    /// Its name.
    pub name: String,
    /// Its text in PDDL; `None` for the goal of the problem.
    pub text: Option<String>,
    /// Its value and its times.
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
    /// A plan is about to be taken up: forgets what is long past, and has the recorder begin anew if it
    /// wants to.
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
        // What was said last is told first, and goes before it.
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

    /// The run rests: forgets what was before, and has the recorder begin anew if it wants to.
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

    /// Has the recorder begin anew if it wants to. The report, and explanations, have what the record
    /// has.
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

    /// Since when the run rests, if nothing is under way, or to be done.
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

    /// The same run, where another one has been; to be called once the run is
    /// [lasting](Run::lasting). Nothing is made of it otherwise.
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
