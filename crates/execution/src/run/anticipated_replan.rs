//! Forecast, while an action is late, of the initial situation of the next plan.
//!
//! With the warning, the planner is notified of that situation: the late action is still running,
//! and until then everything else starts and ends according to the present plan. The forecast is
//! updated when the execution deviates from it. Small differences in time do not matter, because
//! the plan is fitted to the real situation when it is needed.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use super::Run;
use super::background_search::BackgroundSearch;
use super::prediction::{ExpectedStart, LateActionAssumption, PredictedState, PredictionHorizon};
use super::situation::OverrunEstimate;
use crate::event::ActionHandle;
use crate::executor::StepId;
use crate::request::Urgency;

/// The initial situation of the next plan if a late action does not end, as reported to the
/// planner.
pub(super) struct AnticipatedReplan {
    pub(super) prospect: PredictedState,
    /// The time of the forecast.
    pub(super) since: Rational,
    /// The earliest time at which a new plan is needed.
    until: Rational,
    /// `true` if an unexpected event has happened since.
    is_outdated: bool,
    /// The abandoned plan, once the present plan was abandoned.
    abandoned: Option<AbandonedPlanState>,
}

/// State of a plan when it was abandoned.
struct AbandonedPlanState {
    /// The steps that were started.
    steps: BTreeMap<StepId, ActionHandle>,
    /// `true` if the execution had been as foreseen.
    was_as_anticipated: bool,
}

/// A foreseen situation for a request.
pub(super) struct AnticipatedSituation {
    pub(super) prospect: PredictedState,
    pub(super) since: Rational,
    /// The started steps of the abandoned plan.
    pub(super) abandoned_steps: BTreeMap<StepId, ActionHandle>,
    /// `true` if the real situation differs slightly.
    pub(super) is_approximate: bool,
}

/// An action that is foreseen to be running.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum AnticipatedAction {
    Started(ActionHandle),
    Upcoming(StepId),
}

impl Run<'_> {
    /// Notifies the planner of the expected situation at `until`, when a plan will be needed, or
    /// before that if another action is late.
    pub(super) fn announce_expected_situation(&mut self, until: &Rational) {
        if self
            .search
            .as_ref()
            .is_some_and(BackgroundSearch::is_optional)
        {
            // The optional search comes first. If its plan does not take over, there is another
            // call.
            return;
        }
        let until = self.next_need().unwrap_or_else(|| until.clone());
        let time = &until + self.replanning_margin() + self.task.epsilon();
        let prospect = self.anticipated_state(&until, &until, time);
        self.request_plan(&prospect.situation, Urgency::Anticipated);
        self.anticipated_replan = Some(AnticipatedReplan {
            prospect,
            since: self.now.clone(),
            until,
            is_outdated: false,
            abandoned: None,
        });
    }

    fn anticipated_state(
        &self,
        until: &Rational,
        ends_by: &Rational,
        time: Rational,
    ) -> PredictedState {
        self.expected_situation(&PredictionHorizon {
            time,
            starts_before: until.clone(),
            ends_by: ends_by.clone(),
            late_actions: LateActionAssumption::Continues,
        })
    }

    /// Returns the time at which a plan is needed if actions with a warning do not end.
    fn next_need(&self) -> Option<Rational> {
        let needs = self.action_log.open_tickets().filter_map(|ticket| {
            let entry = self.action_log.get(ticket)?;
            let window = self.ports.executor.window(entry.step?, true)?.latest?;
            // If its slack has grown since then, another warning follows.
            let until = entry.warned.clone()?;
            (until >= window && until >= self.now).then_some(until)
        });
        needs.min()
    }

    /// Updates the forecast if the execution deviates from it. Returns the time of the next check.
    pub(super) fn update_forecast(&mut self) -> Option<Rational> {
        if !self.settings.monitors_slack || self.search.is_some() {
            return None;
        }
        let Some(until) = self.next_need() else {
            // The late action has ended, unless the plan is needed now.
            self.anticipated_replan.take_if(|it| it.until > self.now);
            return None;
        };
        let foreseen = self.anticipated_replan.as_ref();
        let is_right = foreseen.is_some_and(|it| it.until == until && self.matches_forecast(it));
        if !is_right {
            self.announce_expected_situation(&until);
        }
        self.next_late_time(&until)
    }

    /// Returns the time at which an action becomes late that was expected to end before then.
    fn next_late_time(&self, until: &Rational) -> Option<Rational> {
        let doubts = self.belief.running().values().filter_map(|underway| {
            let planned = &underway.start + &underway.planned;
            let doubt = &planned + Self::punctuality_tolerance() + self.task.epsilon();
            (planned <= *until && doubt > self.now).then_some(doubt)
        });
        doubts.min()
    }

    /// Records an event that was not foreseen.
    pub(super) fn record_unforeseen_event(&mut self) {
        if let Some(foreseen) = &mut self.anticipated_replan {
            foreseen.is_outdated = true;
        }
    }

    /// Keeps the forecast when the present plan is abandoned, with the steps that were started.
    pub(super) fn keep_forecast(&mut self) {
        if let Some(mut foreseen) = self.anticipated_replan.take() {
            if foreseen.abandoned.is_none() {
                foreseen.abandoned = Some(AbandonedPlanState {
                    steps: self.action_log.steps().clone(),
                    was_as_anticipated: self.matches_forecast(&foreseen),
                });
            }
            self.anticipated_replan = Some(foreseen);
        }
    }

    /// Returns the foreseen situation if it is near and the execution was as foreseen. Small
    /// differences in time are permitted, unless plans are awaited.
    pub(super) fn anticipated_situation(
        &mut self,
        guess: OverrunEstimate,
    ) -> Option<AnticipatedSituation> {
        let foreseen = self.anticipated_replan.take()?;
        let PredictedState {
            situation, running, ..
        } = &foreseen.prospect;
        let earliest = &self.now + self.task.epsilon();
        let latest = &earliest + self.replanning_margin() + &self.expected_planning_time;
        let is_near = (&earliest..=&latest).contains(&&situation.time);
        if !is_near || guess != OverrunEstimate::QuarterLonger {
            return None;
        }
        let (exactly, tickets) = self.situation_at(situation.time.clone(), guess);
        let is_guess = exactly != *situation || tickets != *running;
        let is_as_foreseen = !is_guess
            || self.plans_aside()
                && match &foreseen.abandoned {
                    Some(left) => left.was_as_anticipated && !foreseen.is_outdated,
                    None => self.matches_forecast(&foreseen),
                };
        is_as_foreseen.then(|| AnticipatedSituation {
            abandoned_steps: foreseen
                .abandoned
                .map(|left| left.steps)
                .unwrap_or_default(),
            prospect: foreseen.prospect,
            since: foreseen.since,
            is_approximate: is_guess,
        })
    }

    /// Returns `true` if, by the present forecast, the same actions will be running as was
    /// foreseen.
    fn matches_forecast(&self, foreseen: &AnticipatedReplan) -> bool {
        let until = &foreseen.until;
        let ends_by = (&self.now + self.task.epsilon()).max(until.clone());
        let time = foreseen.prospect.situation.time.clone();
        let anew = || self.anticipated_state(until, &ends_by, time);
        !foreseen.is_outdated
            && self.anticipated_actions(&foreseen.prospect, until)
                == self.anticipated_actions(&anew(), until)
    }

    /// Returns the actions that are foreseen to be running, except those that start or end at about
    /// that time.
    fn anticipated_actions(
        &self,
        prospect: &PredictedState,
        until: &Rational,
    ) -> BTreeSet<AnticipatedAction> {
        let slack = Self::punctuality_tolerance();
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
        let doing = |ticket: ActionHandle| {
            if first.is_none_or(|first| ticket < first) {
                return Some(AnticipatedAction::Started(ticket));
            }
            let is_it = |it: &&ExpectedStart| it.ticket == ticket;
            let step = prospect.expected.iter().find(is_it)?.step;
            let started = self.action_log.ticket(step).map(AnticipatedAction::Started);
            Some(started.unwrap_or(AnticipatedAction::Upcoming(step)))
        };
        running.filter_map(|(ticket, _)| doing(*ticket)).collect()
    }
}
