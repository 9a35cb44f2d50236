//! Forecast, while an action is late, of the initial situation of the next plan.
//!
//! With the warning, the planner is notified of that situation: the late action is still running,
//! and until then everything else starts and ends according to the present plan. The forecast is
//! updated when the execution deviates from it. Small differences in time do not matter, because
//! the plan is fitted to the real situation when it is needed.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use super::Run;
use super::expectation::{Expected, Late, Prospect, Reach};
use super::here::Guess;
use super::search::Search;
use crate::event::Ticket;
use crate::executor::CAN_HAVE_A_CLOCK;
use crate::executor::StepId;
use crate::request::Urgency;

/// The initial situation of the next plan if a late action does not end, as reported to the
/// planner.
pub(super) struct Foreseen {
    pub(super) prospect: Prospect,
    /// The time of the forecast.
    pub(super) since: Rational,
    /// The time from when a new plan is needed.
    until: Rational,
    /// `true` if an unexpected event has happened since.
    is_overtaken: bool,
    /// The abandoned plan, once the present plan was abandoned.
    left: Option<Left>,
}

/// State of a plan when it was abandoned.
struct Left {
    /// The steps that were started.
    steps: BTreeMap<StepId, Ticket>,
    /// `true` if the execution had been as foreseen.
    is_as_foreseen: bool,
}

/// A foreseen situation for a request.
pub(super) struct Ahead {
    pub(super) prospect: Prospect,
    pub(super) since: Rational,
    /// The started steps of the abandoned plan.
    pub(super) left_behind: BTreeMap<StepId, Ticket>,
    /// `true` if the real situation differs slightly.
    pub(super) is_guess: bool,
}

/// An action that is foreseen to be running.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Doing {
    Started(Ticket),
    ToCome(StepId),
}

impl Run<'_> {
    /// Notifies the planner of the expected situation at `until`, when a plan will be needed, or
    /// before that if another action is late.
    pub(super) fn foresee(&mut self, until: &Rational) {
        if self.search.as_ref().is_some_and(Search::is_optional) {
            // The optional search comes first. If its plan does not take over, there is another
            // call.
            return;
        }
        let until = self.next_need().unwrap_or_else(|| until.clone());
        let time = &until + self.margin() + self.task.epsilon();
        let prospect = self.what_is_foreseen(&until, &until, time);
        self.request_plan(&prospect.situation, Urgency::Foreseen);
        self.foreseen = Some(Foreseen {
            prospect,
            since: self.now.clone(),
            until,
            is_overtaken: false,
            left: None,
        });
    }

    fn what_is_foreseen(&self, until: &Rational, ends_by: &Rational, time: Rational) -> Prospect {
        self.expectation(&Reach {
            time,
            starts_before: until.clone(),
            ends_by: ends_by.clone(),
            late: Late::GoesOn,
        })
    }

    /// Returns the time at which a plan is needed if actions with a warning do not end.
    fn next_need(&self) -> Option<Rational> {
        let needs = self.account.open_tickets().filter_map(|ticket| {
            let entry = self.account.get(ticket)?;
            let window = self.ports.executor.window(entry.step?, true)?.latest?;
            // If its slack has grown since, there is another warning.
            let until = entry.warned.clone()?;
            (until >= window && until >= self.now).then_some(until)
        });
        needs.min()
    }

    /// Updates the forecast if the execution deviates from it. Returns the time of the next check.
    pub(super) fn tend_foresight(&mut self) -> Option<Rational> {
        if !CAN_HAVE_A_CLOCK || !self.settings.watches_room || self.search.is_some() {
            return None;
        }
        let Some(until) = self.next_need() else {
            // The late action has ended, unless the plan is needed now.
            self.foreseen.take_if(|it| it.until > self.now);
            return None;
        };
        let foreseen = self.foreseen.as_ref();
        let is_right = foreseen.is_some_and(|it| it.until == until && self.has_come_as(it));
        if !is_right {
            self.foresee(&until);
        }
        self.next_doubt(&until)
    }

    /// Returns the time at which an action becomes late that was expected to end before then.
    fn next_doubt(&self, until: &Rational) -> Option<Rational> {
        let doubts = self.belief.running().values().filter_map(|underway| {
            let planned = &underway.start + &underway.planned;
            let doubt = &planned + Self::slack() + self.task.epsilon();
            (planned <= *until && doubt > self.now).then_some(doubt)
        });
        doubts.min()
    }

    /// Records an event that was not foreseen.
    pub(super) fn note_unforeseen(&mut self) {
        if let Some(foreseen) = &mut self.foreseen {
            foreseen.is_overtaken = true;
        }
    }

    /// Keeps the forecast when the present plan is abandoned, with the steps that were started.
    pub(super) fn keep_foreseen(&mut self) {
        if let Some(mut foreseen) = self.foreseen.take().filter(|_| CAN_HAVE_A_CLOCK) {
            if foreseen.left.is_none() {
                foreseen.left = Some(Left {
                    steps: self.account.steps().clone(),
                    is_as_foreseen: self.has_come_as(&foreseen),
                });
            }
            self.foreseen = Some(foreseen);
        }
    }

    /// Returns the foreseen situation if it is near and the execution was as foreseen. Small
    /// differences in time are permitted, unless plans are awaited.
    pub(super) fn as_foreseen(&mut self, guess: Guess) -> Option<Ahead> {
        let foreseen = self.foreseen.take().filter(|_| CAN_HAVE_A_CLOCK)?;
        let Prospect {
            situation, running, ..
        } = &foreseen.prospect;
        let earliest = &self.now + self.task.epsilon();
        let latest = &earliest + self.margin() + &self.allowance;
        let is_near = (&earliest..=&latest).contains(&&situation.time);
        if !is_near || guess != Guess::AQuarterLonger {
            return None;
        }
        let (exactly, tickets) = self.situation_at(situation.time.clone(), guess);
        let is_guess = exactly != *situation || tickets != *running;
        let is_as_foreseen = !is_guess
            || self.plans_aside()
                && match &foreseen.left {
                    Some(left) => left.is_as_foreseen && !foreseen.is_overtaken,
                    None => self.has_come_as(&foreseen),
                };
        is_as_foreseen.then(|| Ahead {
            left_behind: foreseen.left.map(|left| left.steps).unwrap_or_default(),
            prospect: foreseen.prospect,
            since: foreseen.since,
            is_guess,
        })
    }

    /// Returns `true` if, by the present forecast, the same actions will be running as was
    /// foreseen.
    fn has_come_as(&self, foreseen: &Foreseen) -> bool {
        let until = &foreseen.until;
        let ends_by = (&self.now + self.task.epsilon()).max(until.clone());
        let time = foreseen.prospect.situation.time.clone();
        let anew = || self.what_is_foreseen(until, &ends_by, time);
        !foreseen.is_overtaken
            && self.doings(&foreseen.prospect, until) == self.doings(&anew(), until)
    }

    /// Returns the actions that are foreseen to be running, except those that start or end at about
    /// that time.
    fn doings(&self, prospect: &Prospect, until: &Rational) -> BTreeSet<Doing> {
        let slack = Self::slack();
        let is_about_then = |time: &Rational| *time >= until - &slack && *time <= until + &slack;
        let first = prospect.expected.first().map(|it| it.ticket);
        let running = prospect.running.iter().zip(&prospect.situation.running);
        let running = running.filter(|(_, it)| {
            let end = it
                .duration
                .lower
                .value()
                .map(|duration| &it.start + duration);
            !is_about_then(&it.start) && !end.is_some_and(|end| is_about_then(&end))
        });
        let doing = |ticket: Ticket| {
            if first.is_none_or(|first| ticket < first) {
                return Some(Doing::Started(ticket));
            }
            let is_it = |it: &&Expected| it.ticket == ticket;
            let step = prospect.expected.iter().find(is_it)?.step;
            let started = self.account.ticket(step).map(Doing::Started);
            Some(started.unwrap_or(Doing::ToCome(step)))
        };
        running.filter_map(|(ticket, _)| doing(*ticket)).collect()
    }
}
