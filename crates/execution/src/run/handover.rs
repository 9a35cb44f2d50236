//! From one plan to the next.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Situation;
use elbowroom_num::Rational;

use super::agenda::{Made, Todo};
use super::beginning::Course;
use super::here::{Guess, situation_at};
use super::{PlanningTime, Run, RunningRule, Stop, Verdict};
use crate::event::Ticket;
use crate::planning::PlanAnswer;
use crate::reason::Reason;
use crate::record::Entry;

/// An answer of the planner, and to what.
struct Attempt {
    answer: PlanAnswer,
    situation: Situation,
    running: Vec<Ticket>,
    /// When the time has passed that planning took.
    ready: Rational,
}

impl Run<'_> {
    /// Brings what is running to where a new plan can begin: see [`RunningRule`].
    pub(super) fn settle(&mut self) {
        match self.settings.running {
            RunningRule::Keep => {
                let lost = self.what_cannot_go_on();
                self.agenda.push(Todo::Settle(Some(lost.clone())));
                self.agenda.push(Todo::Cancel(lost));
            }
            RunningRule::Await => self.agenda.push(Todo::Settle(None)),
            RunningRule::Cancel => {
                self.agenda.push(Todo::Settle(None));
                let running = self.account.open_tickets().collect();
                self.agenda.push(Todo::Cancel(running));
            }
        }
    }

    /// Waits for what is awaited, if it has not ended. Each wait ends by the end of somebody's
    /// patience: what stays silent is given up.
    pub(super) fn go_on_settling(&mut self, awaited: Option<Vec<Ticket>>) {
        if let Some(lost) = &awaited {
            // Until it has stopped, it counts as running.
            let mut lost = lost.iter();
            if !lost.any(|ticket| self.belief.running().contains_key(ticket)) {
                return;
            }
        }
        let Some(until) = self.next_silence() else {
            return;
        };
        self.agenda.push(Todo::Settle(awaited));
        self.agenda.push(Todo::GiveUpTheSilent);
        let until = until.max(self.now.clone());
        self.agenda.push(Todo::Pass(until));
    }

    /// A plan can only go on with what has started, and with what it may go on doing.
    fn what_cannot_go_on(&self) -> Vec<Ticket> {
        let breaking = self.belief.breaking().into_iter();
        let breaking: BTreeSet<Ticket> = breaking.map(|(ticket, _)| ticket).collect();
        let is_lost = |ticket: &Ticket| match self.belief.running().get(ticket) {
            Some(underway) => breaking.contains(ticket) || !underway.broken_parts().is_empty(),
            None => true,
        };
        self.account.open_tickets().filter(is_lost).collect()
    }

    /// Asks the planner; the plan is taken up when the time that this takes has passed.
    pub(super) fn plan_from_here(&mut self, reason: &Reason) -> Result<(), Stop> {
        if self.is_to_turn() {
            return Ok(());
        }
        if self.is_paused() {
            self.agenda.push(Todo::Plan(reason.clone()));
            self.stay();
            return Ok(());
        }
        if self.plans_aside() {
            self.search_from_here(reason);
            return Ok(());
        }
        self.news.clear();
        if self.go_without_plan(reason) {
            return Ok(());
        }
        let mut attempt = self.attempt(reason, Guess::AQuarterLonger)?;
        let overdue = self.overdue();
        let has_none = |attempt: &Attempt| !matches!(attempt.answer, PlanAnswer::Plan(_));
        if self.settings.watches_room && has_none(&attempt) && !overdue.is_empty() {
            // What is overdue may still end in time.
            attempt = self.attempt(reason, Guess::AnyMoment)?;
            if has_none(&attempt) {
                // No plan can bear that it goes on: it has failed, and the next one does without.
                self.agenda.push(Todo::Plan(reason.clone()));
                self.agenda.push(Todo::Settle(Some(overdue.clone())));
                self.agenda.push(Todo::Cancel(overdue));
                return Ok(());
            }
        }
        let plan = match attempt.answer {
            PlanAnswer::Unsolvable => return Err(Stop::Over(Verdict::Unsolvable)),
            PlanAnswer::NotFound { why } => return Err(Stop::Over(Verdict::NoPlan { why })),
            PlanAnswer::Failed { why } => return Err(Stop::Over(Verdict::PlannerFailed { why })),
            PlanAnswer::Plan(plan) => plan,
        };
        // What ends from now on is no step of the plan that was given up, and not yet one of the
        // new plan: what it changes is news, and the new plan is told of its end.
        self.account.begin_plan(&BTreeMap::new());
        self.agenda.push(Todo::Adopt(Box::new(Made {
            plan,
            situation: attempt.situation,
            running: attempt.running,
            ready: attempt.ready,
        })));
        Ok(())
    }

    /// Asks the planner once.
    fn attempt(&mut self, reason: &Reason, guess: Guess) -> Result<Attempt, Stop> {
        let foreseen = self.as_foreseen(guess);
        let foreseen = foreseen.map(|it| (it.prospect.situation, it.prospect.running));
        let (situation, running) =
            foreseen.unwrap_or_else(|| self.situation(&self.allowance, guess));
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason,
            situation: &situation,
        });
        let planned = self.ports.planner.plan(&self.task, &situation);
        let took = match &self.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            // The world's time begins when there is a first plan.
            PlanningTime::Measured if self.settings.plans_aside => Rational::ZERO,
            PlanningTime::Measured => planned.seconds.unwrap_or_default(),
        };
        self.expect(&took);
        let ready = &self.now + &took;
        self.ports.recorder.record(&Entry::Planned {
            now: &ready,
            took: &took,
            plan: planned.answer.plan(),
            why_not: planned.answer.why_not(),
            is_unsolvable: planned.answer == PlanAnswer::Unsolvable,
            has_failed: matches!(planned.answer, PlanAnswer::Failed { .. }),
            remark: planned.remark.as_deref(),
        });
        self.heed()?;
        Ok(Attempt {
            answer: planned.answer,
            situation,
            running,
            ready,
        })
    }

    /// Learns from what a plan took what the next one will take: as much, if that is more than was
    /// expected; else less, but only by half at a time. If one long search delayed all plans after it,
    /// a run whose goals come faster than that would not start anything any more.
    pub(super) fn expect(&mut self, took: &Rational) {
        let half = &self.allowance / &Rational::from(2);
        self.allowance = half.max(took.clone());
    }

    /// Takes up a plan, as soon as the time is over that it took to make it.
    pub(super) fn adopt(&mut self, made: Box<Made>) -> Result<(), Stop> {
        if self.is_to_turn() {
            // It was made for other goals.
            return Ok(());
        }
        if self.now < made.ready {
            let ready = made.ready.clone();
            self.agenda.push(Todo::Adopt(made));
            self.agenda.push(Todo::Pass(ready));
            return Ok(());
        }
        let surprises = std::mem::take(&mut self.news);
        self.agenda.push(Todo::Tell(surprises));
        self.take_up(Course::of(&made.plan, &made.situation, &made.running))
    }

    /// Where things will stand when the new plan can begin: after the time that planning is
    /// expected to take, and ε after whatever happens last before that.
    pub(super) fn situation(&self, allowance: &Rational, guess: Guess) -> (Situation, Vec<Ticket>) {
        let epsilon = self.task.epsilon();
        let mut time = &self.now + allowance;
        // Another goal makes another problem, which is written anew for planners that read files.
        if self.now.is_positive() || self.account.started() > 0 || self.has_other_goals() {
            time += epsilon;
        }
        if time.is_zero() {
            return (Situation::initial(&self.task), Vec::new());
        }
        self.situation_at(time, guess)
    }

    /// The same at this time, or ε after the timed initials that come just before it.
    pub(super) fn situation_at(&self, time: Rational, guess: Guess) -> (Situation, Vec<Ticket>) {
        situation_at(&self.belief, time, guess)
    }
}
