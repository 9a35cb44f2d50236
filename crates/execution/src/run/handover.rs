//! Transition from one plan to the next.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;

use super::agenda::{Made, Todo};
use super::beginning::Course;
use super::here::{Guess, situation_at};
use super::{MissingPlan, PlanningTime, Run, RunningRule, Stop, Verdict};
use crate::event::Ticket;
use crate::planning::{PlanAnswer, Planned};
use crate::reason::Reason;
use crate::record::Entry;

/// Request for a plan for which the run waits.
pub(super) struct Attempt {
    pub(super) reason: Reason,
    pub(super) guess: Guess,
    pub(super) situation: Situation,
    pub(super) running: Vec<Ticket>,
    /// `true` if the present plan continues unless the new one is better.
    pub(super) is_optional: bool,
}

/// The next attempt after no plan was found.
pub(super) enum NextAttempt {
    /// A plan with this guess about overdue actions.
    Guess(Guess),
    /// A plan without the overdue actions.
    CancelOverdue,
    /// The present plan.
    CarryOn,
}

impl Run<'_> {
    /// Brings the running actions to a state that permits a new plan: see [`RunningRule`].
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

    /// Waits for the actions in `awaited` that have not ended. Each wait ends at a warning or a
    /// time-out at the latest.
    pub(super) fn go_on_settling(&mut self, awaited: Option<Vec<Ticket>>) {
        if let Some(lost) = &awaited {
            // It counts as running until it has stopped.
            let mut lost = lost.iter();
            if !lost.any(|ticket| self.belief.running().contains_key(ticket)) {
                return;
            }
        }
        self.wait_until_timeout(Todo::Settle(awaited));
    }

    /// Waits for these actions, although a plan could be requested without their ends. The wait
    /// ends early if the goals change, or if doubts are settled or arise.
    pub(super) fn linger(&mut self, tickets: Vec<Ticket>, doubts: usize) {
        let mut running = tickets.iter();
        if running.any(|ticket| self.belief.running().contains_key(ticket))
            && self.belief.doubt_count() == doubts
            && !self.is_to_turn()
        {
            self.wait_until_timeout(Todo::Linger(tickets, doubts));
        }
    }

    /// Waits until the next time-out or its warning at the latest, and performs `todo` then. If
    /// nothing can time out, nothing is running.
    fn wait_until_timeout(&mut self, todo: Todo) {
        let Some(until) = self.next_timeout() else {
            return;
        };
        self.agenda.push(todo);
        self.agenda.push(Todo::CheckTimeouts);
        let until = until.max(self.now.clone());
        self.agenda.push(Todo::Pass(until));
    }

    /// Returns the actions that no plan can continue: those that have not started, and those whose
    /// over-all condition fails.
    fn what_cannot_go_on(&self) -> Vec<Ticket> {
        let breaking = self.belief.breaking().into_iter();
        let breaking: BTreeSet<Ticket> = breaking.map(|(ticket, _)| ticket).collect();
        let is_lost = |ticket: &Ticket| match self.belief.running().get(ticket) {
            Some(underway) => breaking.contains(ticket) || !underway.broken_parts().is_empty(),
            None => true,
        };
        self.account.open_tickets().filter(is_lost).collect()
    }

    /// Requests a plan; see [`Run::take_plan`] for its answer.
    pub(super) fn plan_from_here(&mut self, reason: &Reason) -> Result<(), Stop> {
        if self.is_to_turn() {
            return Ok(());
        }
        if self.is_paused() {
            self.agenda.push(Todo::Plan(reason.clone()));
            self.stay();
            return Ok(());
        }
        if let Some((time, verdict)) = &self.lost.in_vain
            && *time == self.now
        {
            return Err(Stop::Over(verdict.clone()));
        }
        if self.inquire(reason) {
            return Ok(());
        }
        self.stop_if_goal_is_in_doubt()?;
        if self.plans_aside() {
            self.search_from_here(reason);
            return Ok(());
        }
        self.news.clear();
        if self.go_without_plan(reason) {
            return Ok(());
        }
        self.attempt(reason, Guess::AQuarterLonger)
    }

    /// Requests a plan, for which the run waits.
    fn attempt(&mut self, reason: &Reason, guess: Guess) -> Result<(), Stop> {
        let foreseen = self.as_foreseen(guess);
        let foreseen = foreseen.map(|it| (it.prospect.situation, it.prospect.running));
        let (situation, running) =
            foreseen.unwrap_or_else(|| self.situation(&self.allowance, guess));
        let is_known = |(task, known, before): &(Arc<Task>, Situation, Guess)| {
            Arc::ptr_eq(task, &self.task) && *known == situation && *before == guess
        };
        if self.planned_for.as_ref().is_some_and(is_known) {
            let why = format!("the executor rejects the plan that exists: {reason}");
            let missing = MissingPlan::Rejected;
            return self.carry_on_or_stop(Verdict::NoPlan { why, missing });
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
    pub(super) fn take_plan(&mut self, attempt: Attempt, planned: Planned) -> Result<(), Stop> {
        let took = match &self.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            // The world's clock starts when there is a first plan.
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
            shortfall: &planned.shortfall,
        });
        self.note_shortfall(&self.goals(), &planned.shortfall);
        self.heed()?;
        if attempt.is_optional {
            match planned.answer {
                PlanAnswer::Plan(plan) => self.prepare_better_plan(attempt, &plan),
                answer => self.note_no_better_plan(&answer),
            }
            return Ok(());
        }
        let plan = match planned.answer {
            PlanAnswer::Plan(_) if attempt.guess == Guess::Cancelled => {
                self.cancel_overdue(attempt.reason);
                return Ok(());
            }
            PlanAnswer::Plan(plan) => {
                let task = Arc::clone(&self.task);
                self.planned_for = Some((task, attempt.situation.clone(), attempt.guess));
                plan
            }
            answer => {
                let next = self.next_attempt(attempt.guess);
                return match next {
                    NextAttempt::Guess(guess) => self.attempt(&attempt.reason, guess),
                    NextAttempt::CancelOverdue => {
                        self.cancel_overdue(attempt.reason);
                        Ok(())
                    }
                    NextAttempt::CarryOn => self.go_on_without_plan(&answer, attempt.reason),
                };
            }
        };
        // Actions that end before the adoption belong to neither plan. Their effects are news, and
        // the new plan receives their ends.
        self.account.begin_plan(&BTreeMap::new());
        self.agenda.push(Todo::Adopt(Box::new(Made {
            plan,
            situation: attempt.situation,
            running: attempt.running,
            ready,
        })));
        Ok(())
    }

    /// Returns the next attempt after no plan was found with this guess about overdue actions.
    pub(super) fn next_attempt(&self, guess: Guess) -> NextAttempt {
        if !self.settings.watches_room || self.overdue().is_empty() {
            return NextAttempt::CarryOn;
        }
        match guess {
            // Overdue actions may still end in time.
            Guess::AQuarterLonger => NextAttempt::Guess(Guess::AnyMoment),
            // They are only cancelled if there is a plan without them.
            Guess::AnyMoment if self.may_carry_on() => NextAttempt::Guess(Guess::Cancelled),
            Guess::AnyMoment => NextAttempt::CancelOverdue,
            Guess::Cancelled => NextAttempt::CarryOn,
        }
    }

    /// Cancels the overdue actions, which count as failed then, and requests a plan.
    pub(super) fn cancel_overdue(&mut self, reason: Reason) {
        let overdue = self.overdue();
        self.agenda.push(Todo::Plan(reason));
        self.agenda.push(Todo::Settle(Some(overdue.clone())));
        self.agenda.push(Todo::Cancel(overdue));
    }

    /// Updates the expected planning time: to the last planning time if that is greater, otherwise
    /// to no less than half of the previous value. If one long search delayed all later plans, a
    /// run with frequent new goals would never start anything.
    pub(super) fn expect(&mut self, took: &Rational) {
        let half = &self.allowance / &Rational::from(2);
        self.allowance = half.max(took.clone());
    }

    /// Adopts a plan when its planning time has passed.
    pub(super) fn adopt(&mut self, made: Box<Made>) {
        if self.is_to_turn() {
            // It was made for other goals.
            return;
        }
        if self.now < made.ready {
            let ready = made.ready.clone();
            self.agenda.push(Todo::Adopt(made));
            self.agenda.push(Todo::Pass(ready));
            return;
        }
        let surprises = std::mem::take(&mut self.news);
        self.agenda.push(Todo::Tell(surprises));
        self.take_up(Course::of(&made.plan, &made.situation, &made.running));
    }

    /// Returns the situation when the new plan can start: after the expected planning time, and ε
    /// after the last event before that.
    pub(super) fn situation(&self, allowance: &Rational, guess: Guess) -> (Situation, Vec<Ticket>) {
        let epsilon = self.task.epsilon();
        let mut time = &self.now + allowance;
        // With other goals, the problem is a different one, and is written again for planners that
        // read files.
        if self.now.is_positive() || self.account.started() > 0 || self.has_other_goals() {
            time += epsilon;
        }
        if time.is_zero() {
            return (Situation::initial(&self.task), Vec::new());
        }
        self.situation_at(time, guess)
    }

    /// Returns the situation at this time, or ε after the timed initials that come just before it.
    pub(super) fn situation_at(&self, time: Rational, guess: Guess) -> (Situation, Vec<Ticket>) {
        if guess != Guess::Cancelled {
            return situation_at(&self.belief, time, guess);
        }
        let mut belief = self.belief.clone();
        for ticket in self.overdue() {
            belief.stop(ticket);
        }
        situation_at(&belief, time, guess)
    }
}
