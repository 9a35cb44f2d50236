//! Processing of reports: each report counts once, and implausible ones are corrected or ignored.

use elbowroom_model::ground::{Action, Body, Expression};
use elbowroom_num::Rational;

use super::Run;
use super::background::BackgroundSearch;
use super::history::BelievedEventKind;
use crate::event::{ActionHandle, Ending, Event, Measured, Observation};
use crate::executor::{Amount, PlanEvent, Planned};
use crate::measured_amounts;
use crate::record::Entry;

/// The objection to a report that is ignored or corrected.
pub(super) type Remark = Option<&'static str>;

const TIME_IN_FUTURE: &str = "its time is in the future; taken as now";
const TIME_BEFORE_COMMAND: &str = "its time is before the command; taken as then";
const TIME_BEFORE_START: &str = "its time is before its start; taken as then";
const START_NOT_REPORTED: &str = "its start was not reported";
const START_ASSUMED_AT_COMMAND: &str =
    "its start was not reported; taken as the time of the request";

/// Returns `true` if a remark on a report means that the report was counted with another time, or
/// with an assumed start. Other remarks are on reports that were ignored, contradict an earlier
/// report, or came after a time-out.
pub fn is_correction(remark: &str) -> bool {
    [
        TIME_IN_FUTURE,
        TIME_BEFORE_COMMAND,
        TIME_BEFORE_START,
        START_NOT_REPORTED,
        START_ASSUMED_AT_COMMAND,
    ]
    .contains(&remark)
}

/// Objection to a report on a ticket that was never issued.
const UNKNOWN_TICKET: &str = "no action with this ticket was started";

/// Objection to a report on a start that is no longer known.
const FORGOTTEN_TICKET: &str = "the action has ended long ago";

impl Run<'_> {
    /// Updates the belief with the reports, as far as they are credible, and records the news.
    pub(super) fn process_reports(&mut self, observations: Vec<Observation>) {
        let timed_before = self.belief.past_timed_initials();
        // Deadlines are later than release times.
        self.with_goals(super::goals::GoalManager::release_goals);
        // For each observation, the earliest time among it and the later ones; in reverse order.
        let mut earliest: Vec<Rational> = Vec::with_capacity(observations.len());
        for observation in observations.iter().rev() {
            let time = &observation.time;
            let time = earliest.last().map_or(time, |later| later.min(time));
            earliest.push(time.clone());
        }
        for observation in observations {
            if let Some(time) = earliest.pop() {
                self.with_goals(|goals, it| goals.close_goals_due_before(it, &time));
            }
            let planned = self.planned_window(&observation.event);
            let remark = self.process_report(&observation);
            self.ports.recorder.record(&Entry::Taken {
                now: &self.now,
                observation: &observation,
                planned: &planned,
                remark,
            });
        }
        // The belief advances when all events up to now are known.
        let now = self.now.clone();
        self.with_goals(|goals, it| goals.close_goals_due_before(it, &now));
        let _ = self.belief.advance(&now);
        self.with_goals(super::goals::GoalManager::close_momentary_goals);
        self.with_goals(super::goals::GoalManager::tend_kept_goals);
        self.record_timed_initials_while_idle(timed_before);
        (self.listener)(&self.belief);
    }

    fn planned_window(&self, event: &Event) -> Planned {
        let (ticket, is_end) = match event {
            Event::Started { ticket, .. } => (*ticket, false),
            Event::Ended { ticket, .. } => (*ticket, true),
            Event::Feedback { .. }
            | Event::Fact { .. }
            | Event::Value { .. }
            | Event::Requested(_)
            | Event::PlanMade
            | Event::PlanReady
            | Event::Unintelligible { .. } => return Planned::default(),
        };
        let step = self.action_log.get(ticket).and_then(|entry| entry.step);
        let window = step.and_then(|step| self.ports.executor.window(step, is_end));
        window.unwrap_or_default()
    }

    fn process_report(&mut self, observation: &Observation) -> Remark {
        let is_early = observation.time > self.now;
        let time = observation.time.clone().min(self.now.clone());
        let remark = match &observation.event {
            Event::Started { ticket, measured } => self.process_start(*ticket, &time, measured),
            Event::Ended {
                ticket,
                ending,
                measured,
            } => self.process_end(*ticket, &time, ending, measured),
            Event::Feedback {
                ticket, completion, ..
            } => self.process_progress(*ticket, &time, completion.as_ref()),
            Event::Fact { fact, truth } => {
                self.advance_belief(&time);
                if self.task.is_derived(*fact) {
                    return Some("is derived from other facts; the report is ignored");
                }
                if self.belief.observe_fact(*fact, *truth) {
                    self.record_believed_event(&time, BelievedEventKind::Fact(*fact, *truth));
                    self.background.note_unexpected_event();
                    self.plan_events.push(PlanEvent::Fact(*fact));
                }
                None
            }
            Event::Value { fluent, value } => {
                self.advance_belief(&time);
                if self.belief.observe_value(*fluent, value) {
                    self.record_believed_event(
                        &time,
                        BelievedEventKind::Value(*fluent, value.clone()),
                    );
                    self.background.note_unexpected_event();
                    self.plan_events.push(PlanEvent::Value(*fluent));
                }
                None
            }
            Event::Requested(request) => return self.process_request(request),
            Event::PlanMade => {
                let search = self.background.search_mut();
                let is_new = search.is_some_and(BackgroundSearch::note_finished);
                return (!is_new).then_some("no plan was being made");
            }
            Event::PlanReady => {
                let search = self.background.search_mut();
                let is_new = search.is_some_and(|search| search.note_ready(&self.now));
                return (!is_new).then_some("no plan was being prepared");
            }
            Event::Unintelligible { said, why } => {
                self.clock_watchdog.record_unreadable_message(said, why);
                return Some("cannot be parsed; it is ignored");
            }
        };
        remark.or(is_early.then_some(TIME_IN_FUTURE))
    }

    /// Processes a report on the completion of a running action.
    fn process_progress(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        done: Option<&Rational>,
    ) -> Remark {
        match self.action_log.recent(ticket) {
            None => Some(self.unknown_ticket_remark(ticket)),
            Some(entry) if entry.ended.is_some() => Some("the action had already ended"),
            Some(_) => {
                if let Some(done) = done {
                    self.action_log.note_progress(ticket, time, done);
                }
                None
            }
        }
    }

    /// Returns the objection to a report on an unknown ticket.
    fn unknown_ticket_remark(&self, ticket: ActionHandle) -> &'static str {
        if self.action_log.is_forgotten(ticket) {
            FORGOTTEN_TICKET
        } else {
            UNKNOWN_TICKET
        }
    }

    /// Records an observation that was believed, for a later explanation of a dead end.
    pub(super) fn record_believed_event(&mut self, time: &Rational, kind: BelievedEventKind) {
        self.search_results.forget_failure();
        if !matches!(kind, BelievedEventKind::Stopped(_)) {
            self.refusal_backoff.reset();
        }
        self.history.record(time, kind);
    }

    /// Advances the belief to the time of a report. The belief never goes back in time, so a late
    /// report changes the present state. Reports with the same time form one group.
    pub(super) fn advance_belief(&mut self, time: &Rational) {
        let _ = self.belief.advance_for_happening(time);
    }

    fn process_start(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        measured: &[Measured],
    ) -> Remark {
        let Some(entry) = self.action_log.recent(ticket) else {
            return Some(self.unknown_ticket_remark(ticket));
        };
        if entry.started.is_some() {
            return Some("the action had already started");
        }
        if entry.ended.is_some() {
            return Some("the action had already ended");
        }
        let is_too_early = *time < entry.commanded;
        let time = time.clone().max(entry.commanded.clone());
        self.begin(ticket, &time, measured);
        is_too_early.then_some(TIME_BEFORE_COMMAND)
    }

    /// Records that an action has started, or that an instantaneous action has happened.
    fn begin(&mut self, ticket: ActionHandle, time: &Rational, measured: &[Measured]) {
        let Some(entry) = self.action_log.get(ticket) else {
            return;
        };
        let (action, step) = (entry.action.clone(), entry.step);
        let planned = entry.planned.clone().unwrap_or_default();
        self.advance_belief(time);
        if !measured.is_empty() {
            // The executor of the next plan does not receive the amounts, only the resulting values.
            self.background.note_unexpected_effects();
        }
        let amounts = self.amounts(&action, false, Some(&planned), measured);
        // An effect that cannot be computed does not change its fluent.
        let _ = self.belief.start(ticket, &action, &planned, measured);
        self.record_believed_event(time, BelievedEventKind::Started(ticket));
        self.action_log.note_start(ticket, time, measured);
        match step {
            Some(step) => self.plan_events.push(PlanEvent::Started {
                step,
                time: time.clone(),
                measured: amounts,
            }),
            None => self.report_effects(ticket, false),
        }
    }

    fn process_end(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        ending: &Ending,
        measured: &[Measured],
    ) -> Remark {
        let Some(entry) = self.action_log.recent(ticket) else {
            return Some(self.unknown_ticket_remark(ticket));
        };
        if let Some((_, earlier)) = &entry.ended {
            if entry.is_in_doubt {
                return self.process_late_end(ticket, time, ending, measured);
            }
            let is_same = std::mem::discriminant(earlier) == std::mem::discriminant(ending);
            let are_both_without_end =
                *earlier != Ending::Succeeded && *ending != Ending::Succeeded;
            if is_same || are_both_without_end {
                return Some("the action had already ended");
            }
            self.process_contradiction(ticket);
            return Some(
                "the reported end differs from an earlier one; the facts and numbers that the \
                 action changes are now unknown",
            );
        }
        let is_refused = entry.started.is_none() && *ending != Ending::Succeeded;
        let was_silent = entry.started.is_none() && !is_refused;
        let earliest = entry.started.as_ref().unwrap_or(&entry.commanded).clone();
        let is_too_early = *time < earliest;
        let time = time.clone().max(earliest.clone());
        if was_silent {
            self.begin(ticket, &earliest, &[]);
        }
        let step = self.action_log.get(ticket).and_then(|entry| entry.step);
        self.advance_belief(&time);
        if !measured.is_empty() {
            // The executor of the next plan does not receive the amounts, only the resulting values.
            self.background.note_unexpected_effects();
        }
        let mut amounts = Vec::new();
        if *ending == Ending::Succeeded {
            if let Some(underway) = self.belief.running().get(&ticket) {
                let (action, took) = (underway.action.clone(), &time - &underway.start);
                amounts = self.amounts(&action, true, Some(&took), measured);
            }
            let _ = self.belief.end(ticket, measured);
            self.record_believed_event(&time, BelievedEventKind::Ended(ticket));
        } else {
            self.belief.stop(ticket);
            self.record_believed_event(&time, BelievedEventKind::Stopped(ticket));
            self.background.note_unexpected_event();
            if is_refused && let Some(entry) = self.action_log.get(ticket) {
                self.refusal_backoff
                    .record_refusal(&entry.action.name, &self.now);
            }
        }
        // An instantaneous action ends when it starts; later reports contain nothing new.
        let is_over = self
            .action_log
            .get(ticket)
            .is_some_and(|entry| entry.ended.is_some());
        if is_over {
            return was_silent.then_some(START_NOT_REPORTED);
        }
        let timed_out = self
            .action_log
            .get(ticket)
            .and_then(|it| it.timed_out.clone());
        if let Some(since) = timed_out.filter(|_| *ending != Ending::Succeeded) {
            self.end_timed_out(ticket, &time, since);
            return None;
        }
        self.action_log.note_end(ticket, &time, ending, measured);
        if *ending == Ending::Succeeded {
            self.replans.note_progress();
        }
        match step {
            Some(step) => self.plan_events.push(PlanEvent::Ended {
                step,
                time,
                ending: ending.clone(),
                measured: amounts,
            }),
            None if *ending == Ending::Succeeded => self.report_effects(ticket, true),
            None => {}
        }
        match () {
            () if was_silent => Some(START_ASSUMED_AT_COMMAND),
            () if is_too_early => Some(TIME_BEFORE_START),
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
            if let Some(expression) =
                measured_amounts::amount_expression(action, is_end, measured.fluent)
            {
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
    fn process_contradiction(&mut self, ticket: ActionHandle) {
        let Some(entry) = self.action_log.get(ticket) else {
            return;
        };
        let action = entry.action.clone();
        self.doubt(ticket, &action, true);
        self.background.note_unexpected_effects();
        self.plan_events.push(PlanEvent::Contradiction {
            action: action.name.clone(),
        });
    }

    /// Reports the effects of an action of an earlier plan as news. The present plan does not
    /// contain the action, but may read its effects.
    pub(super) fn report_effects(&mut self, ticket: ActionHandle, is_end: bool) {
        let Some(entry) = self.action_log.get(ticket) else {
            return;
        };
        let effects = match &entry.action.body {
            Body::Instantaneous(snap) => &snap.effects,
            Body::Durative(body) if is_end => &body.end.effects,
            Body::Durative(body) => &body.start.effects,
        };
        for effect in effects {
            self.plan_events
                .push(PlanEvent::from_change(&effect.change));
        }
    }
}
