//! Processing of reports: each report counts once, and implausible ones are corrected or ignored.

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Expression};
use elbowroom_num::Rational;

use super::Run;
use super::dead_end::What;
use crate::event::{Ending, Event, Measured, Observation, Ticket};
use crate::executor::{Amount, News, Planned};
use crate::quantities;
use crate::record::Entry;

/// The objection to a report that is ignored or corrected.
pub(super) type Remark = Option<&'static str>;

const IN_THE_FUTURE: &str = "its time is in the future; taken as now";
const BEFORE_THE_COMMAND: &str = "its time is before the command; taken as then";
const BEFORE_THE_START: &str = "its time is before its start; taken as then";
const WITHOUT_A_START: &str = "its start was not reported";
const WITH_THE_COMMAND: &str = "its start was not reported; taken as the time of the request";

/// Returns `true` if a remark on a report means that the report was counted with another time, or
/// with an assumed start. Other remarks are on reports that were ignored, contradict an earlier
/// report, or came after a time-out.
pub fn is_correction(remark: &str) -> bool {
    [
        IN_THE_FUTURE,
        BEFORE_THE_COMMAND,
        BEFORE_THE_START,
        WITHOUT_A_START,
        WITH_THE_COMMAND,
    ]
    .contains(&remark)
}

/// Objection to a report on a ticket that was never issued.
const NEVER_STARTED: &str = "nothing of that number was started";

/// Objection to a report on a start that is no longer known.
const LONG_PAST: &str = "it had ended, and was long past";

impl Run<'_> {
    /// Updates the belief with the reports, as far as they are credible, and records the news.
    pub(super) fn take_in(&mut self, observations: Vec<Observation>) {
        let timed_before = self.belief.timed_past();
        // For each observation, the earliest time among it and the later ones; in reverse order.
        let mut earliest: Vec<Rational> = Vec::with_capacity(observations.len());
        for observation in observations.iter().rev() {
            let time = &observation.time;
            let time = earliest.last().map_or(time, |later| later.min(time));
            earliest.push(time.clone());
        }
        for observation in observations {
            if let Some(time) = earliest.pop() {
                self.close_goals_due_before(&time);
            }
            let planned = self.planned_window(&observation.event);
            let remark = self.take(&observation);
            self.ports.recorder.record(&Entry::Taken {
                now: &self.now,
                observation: &observation,
                planned: &planned,
                remark,
            });
        }
        // The belief advances when all events up to now are known.
        let now = self.now.clone();
        self.close_goals_due_before(&now);
        let _ = self.belief.advance(&now);
        self.close_momentary_goals();
        self.note_timed_at_rest(timed_before);
        (self.listener)(&self.belief);
    }

    fn planned_window(&self, event: &Event) -> Planned {
        let (ticket, is_end) = match event {
            Event::Started { ticket, .. } => (*ticket, false),
            Event::Ended { ticket, .. } => (*ticket, true),
            Event::Feedback { .. }
            | Event::Fact { .. }
            | Event::Value { .. }
            | Event::Asked(_)
            | Event::PlanMade
            | Event::PlanReady
            | Event::Unintelligible { .. } => return Planned::default(),
        };
        let step = self.account.get(ticket).and_then(|entry| entry.step);
        let window = step.and_then(|step| self.ports.executor.window(step, is_end));
        window.unwrap_or_default()
    }

    fn take(&mut self, observation: &Observation) -> Remark {
        let is_early = observation.time > self.now;
        let time = observation.time.clone().min(self.now.clone());
        let remark = match &observation.event {
            Event::Started { ticket, measured } => self.started(*ticket, &time, measured),
            Event::Ended {
                ticket,
                ending,
                measured,
            } => self.ended(*ticket, &time, ending, measured),
            Event::Feedback {
                ticket, completion, ..
            } => self.progressed(*ticket, &time, completion.as_ref()),
            Event::Fact { fact, truth } => {
                self.believe_until(&time);
                if self.task.is_derived(*fact) {
                    return Some("follows from other facts, and is not believed by itself");
                }
                if self.belief.see_fact(*fact, *truth) {
                    self.note(&time, What::Fact(*fact, *truth));
                    self.note_surprise();
                    self.news.push(News::Fact(*fact));
                }
                None
            }
            Event::Value { fluent, value } => {
                self.believe_until(&time);
                if self.belief.see_value(*fluent, value) {
                    self.note(&time, What::Value(*fluent, value.clone()));
                    self.note_surprise();
                    self.news.push(News::Value(*fluent));
                }
                None
            }
            Event::Asked(request) => return self.asked_for(request),
            Event::PlanMade => return self.note_plan_made(),
            Event::PlanReady => return self.note_plan_ready(),
            Event::Unintelligible { said, why } => {
                self.progress.note_unintelligible(said, why);
                return Some("cannot be understood; nothing was made of it");
            }
        };
        remark.or(is_early.then_some(IN_THE_FUTURE))
    }

    /// Processes a report on the completion of a running action.
    fn progressed(&mut self, ticket: Ticket, time: &Rational, done: Option<&Rational>) -> Remark {
        match self.account.recent(ticket) {
            None => Some(self.unknown(ticket)),
            Some(entry) if entry.ended.is_some() => Some("it had ended already"),
            Some(_) => {
                if let Some(done) = done {
                    self.account.note_progress(ticket, time, done);
                }
                None
            }
        }
    }

    /// Returns the objection to a report on an unknown ticket.
    fn unknown(&self, ticket: Ticket) -> &'static str {
        if self.account.is_forgotten(ticket) {
            LONG_PAST
        } else {
            NEVER_STARTED
        }
    }

    /// Advances the belief to the time of a report. The belief never goes back in time, so a late
    /// report changes the present state. Reports with the same time form one group.
    pub(super) fn believe_until(&mut self, time: &Rational) {
        let _ = self.belief.arrive(time);
    }

    fn started(&mut self, ticket: Ticket, time: &Rational, measured: &[Measured]) -> Remark {
        let Some(entry) = self.account.recent(ticket) else {
            return Some(self.unknown(ticket));
        };
        if entry.started.is_some() {
            return Some("it had started already");
        }
        if entry.ended.is_some() {
            return Some("it had ended already");
        }
        let is_too_early = *time < entry.ordered;
        let time = time.clone().max(entry.ordered.clone());
        self.begin(ticket, &time, measured);
        is_too_early.then_some(BEFORE_THE_COMMAND)
    }

    /// Records that an action has started, or that an instantaneous action has happened.
    fn begin(&mut self, ticket: Ticket, time: &Rational, measured: &[Measured]) {
        let Some(entry) = self.account.get(ticket) else {
            return;
        };
        let (action, step) = (entry.action.clone(), entry.step);
        let planned = entry.planned.clone().unwrap_or_default();
        self.believe_until(time);
        self.note_measured(measured);
        let amounts = self.amounts(&action, false, Some(&planned), measured);
        // An effect that cannot be computed does not change its fluent.
        let _ = self.belief.start(ticket, &action, &planned, measured);
        self.note(time, What::Started(ticket));
        self.account.note_start(ticket, time, measured);
        match step {
            Some(step) => self.news.push(News::Started {
                step,
                time: time.clone(),
                measured: amounts,
            }),
            None => self.tell_effects(ticket, false),
        }
    }

    fn ended(
        &mut self,
        ticket: Ticket,
        time: &Rational,
        ending: &Ending,
        measured: &[Measured],
    ) -> Remark {
        let Some(entry) = self.account.recent(ticket) else {
            return Some(self.unknown(ticket));
        };
        if let Some((_, earlier)) = &entry.ended {
            if entry.is_in_doubt {
                return self.ended_after_all(ticket, time, ending, measured);
            }
            let is_same = std::mem::discriminant(earlier) == std::mem::discriminant(ending);
            let are_both_without_end =
                *earlier != Ending::Succeeded && *ending != Ending::Succeeded;
            if is_same || are_both_without_end {
                return Some("it had ended already");
            }
            self.contradict(ticket);
            return Some(
                "it had ended otherwise; the facts and numbers it changes are unknown now",
            );
        }
        let is_refused = entry.started.is_none() && *ending != Ending::Succeeded;
        let was_silent = entry.started.is_none() && !is_refused;
        let earliest = entry.started.as_ref().unwrap_or(&entry.ordered).clone();
        let is_too_early = *time < earliest;
        let time = time.clone().max(earliest.clone());
        if was_silent {
            self.begin(ticket, &earliest, &[]);
        }
        let step = self.account.get(ticket).and_then(|entry| entry.step);
        self.believe_until(&time);
        self.note_measured(measured);
        let mut amounts = Vec::new();
        if *ending == Ending::Succeeded {
            if let Some(underway) = self.belief.running().get(&ticket) {
                let (action, took) = (underway.action.clone(), &time - &underway.start);
                amounts = self.amounts(&action, true, Some(&took), measured);
            }
            let _ = self.belief.end(ticket, measured);
            self.note(&time, What::Ended(ticket));
        } else {
            self.belief.stop(ticket);
            self.note(&time, What::Stopped(ticket));
            self.note_surprise();
            if is_refused && let Some(entry) = self.account.get(ticket) {
                self.refusals.note(&entry.action.name, &self.now);
            }
        }
        // An instantaneous action ends when it starts; later reports contain nothing new.
        let is_over = self
            .account
            .get(ticket)
            .is_some_and(|entry| entry.ended.is_some());
        if is_over {
            return was_silent.then_some(WITHOUT_A_START);
        }
        let timed_out = self.account.get(ticket).and_then(|it| it.timed_out.clone());
        if let Some(since) = timed_out.filter(|_| *ending != Ending::Succeeded) {
            self.end_timed_out(ticket, &time, since);
            return None;
        }
        self.account.note_end(ticket, &time, ending, measured);
        match step {
            Some(step) => self.news.push(News::Ended {
                step,
                time,
                ending: ending.clone(),
                measured: amounts,
            }),
            None if *ending == Ending::Succeeded => self.tell_effects(ticket, true),
            None => {}
        }
        match () {
            () if was_silent => Some(WITH_THE_COMMAND),
            () if is_too_early => Some(BEFORE_THE_START),
            () => None,
        }
    }

    /// Returns the measured amounts, with the inputs of the nominal ones. To be called before the
    /// effects are applied.
    fn amounts(
        &self,
        action: &Action,
        is_end: bool,
        duration: Option<&Rational>,
        measured: &[Measured],
    ) -> Vec<Amount> {
        let amount = |measured: &Measured| {
            let mut values = Vec::new();
            if let Some(expression) = quantities::expression(action, is_end, measured.fluent) {
                expression.visit_leaves(&mut |leaf| {
                    if let Expression::Fluent(fluent) = leaf {
                        let value = self.belief.value_on_arrival(*fluent);
                        values.extend(value.map(|value| (*fluent, value.clone())));
                    }
                });
            }
            Amount {
                measured: measured.clone(),
                duration: duration.cloned(),
                values,
            }
        };
        measured.iter().map(amount).collect()
    }

    /// Processes contradictory reports: the effects of the action's end are in doubt.
    fn contradict(&mut self, ticket: Ticket) {
        let Some(entry) = self.account.get(ticket) else {
            return;
        };
        let action = entry.action.clone();
        self.doubt(ticket, &action, true);
        self.note_disagreement();
        self.news.push(News::Contradiction {
            action: action.name.clone(),
        });
    }

    /// Reports the effects of an action of an earlier plan as news. The present plan does not
    /// contain the action, but may read its effects.
    pub(super) fn tell_effects(&mut self, ticket: Ticket, is_end: bool) {
        let Some(entry) = self.account.get(ticket) else {
            return;
        };
        let effects = match &entry.action.body {
            Body::Instantaneous(snap) => &snap.effects,
            Body::Durative(body) if is_end => &body.end.effects,
            Body::Durative(body) => &body.start.effects,
        };
        for effect in effects {
            self.news.push(News::of_change(&effect.change));
        }
    }

    /// Cancels an action that has reached its time-out. If it was cancelled before and has not
    /// ended, it counts as failed, and its end effects are in doubt.
    pub(super) fn time_out(&mut self, ticket: Ticket, since: Rational) {
        let Some(entry) = self.account.get(ticket) else {
            return;
        };
        if entry.cancelled.is_none() {
            self.account.note_timeout(ticket, &since);
            self.cancel(vec![ticket]);
            return;
        }
        let since = entry.timed_out.clone().unwrap_or(since);
        let (action, has_started) = (Arc::clone(&entry.action), entry.started.is_some());
        self.belief.stop(ticket);
        self.note_disagreement();
        let now = self.now.clone();
        self.note(&now, What::Stopped(ticket));
        self.doubt(ticket, &action, has_started);
        self.account.note_doubt(ticket, true);
        self.end_timed_out(ticket, &now, since);
    }

    /// Ends an action that has timed out: it has ended without its effects, or counts as ended.
    fn end_timed_out(&mut self, ticket: Ticket, time: &Rational, since: Rational) {
        let entry = self.account.get(ticket);
        let Some((action, step)) = entry.map(|entry| (entry.action.name.clone(), entry.step))
        else {
            return;
        };
        let why = "it timed out".to_owned();
        self.account
            .note_end(ticket, time, &Ending::Failed { why }, &[]);
        if step.is_some() {
            self.news.push(News::Silence { action, since });
        }
    }
}
