//! Forecast, while an action is late, of the initial situation of the next plan.
//!
//! With the warning, the planner is notified of that situation: the late action is still running,
//! and until then everything else starts and ends according to the present plan. The forecast is
//! updated when the execution deviates from it. Small differences in time do not matter, because
//! the plan is fitted to the real situation when it is needed.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Situation;
use elbowroom_num::Rational;

use crate::event::ActionHandle;
use crate::executor::StepId;
use crate::run::situation::OverrunEstimate;
use crate::run::view::{
    ExpectedStart, LateActionAssumption, PredictedState, PredictionHorizon, RunView,
    punctuality_tolerance,
};

/// The initial situation of the next plan if a late action does not end, as reported to the
/// planner.
pub(in crate::run) struct AnticipatedReplan {
    prospect: PredictedState,
    /// The time of the forecast.
    since: Rational,
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
pub(in crate::run) struct AnticipatedSituation {
    pub(in crate::run) prospect: PredictedState,
    pub(in crate::run) since: Rational,
    /// The started steps of the abandoned plan.
    pub(in crate::run) abandoned_steps: BTreeMap<StepId, ActionHandle>,
    /// `true` if the real situation differs slightly.
    pub(in crate::run) is_approximate: bool,
}

/// An action that is foreseen to be running.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum AnticipatedAction {
    Started(ActionHandle),
    Upcoming(StepId),
}

impl AnticipatedReplan {
    /// Returns the expected situation when a plan will be needed: at `until`, or before that if
    /// another action is late.
    pub(in crate::run) fn at(until: &Rational, view: &RunView<'_>) -> Self {
        let until = next_need(view).unwrap_or_else(|| until.clone());
        let time = &until + view.replanning_margin() + view.task.epsilon();
        Self {
            prospect: anticipated_state(view, &until, &until, time),
            since: view.now.clone(),
            until,
            is_outdated: false,
            abandoned: None,
        }
    }

    pub(in crate::run) fn situation(&self) -> &Situation {
        &self.prospect.situation
    }

    /// Returns `true` if a new plan is needed later than `now` at the earliest.
    pub(super) fn is_after(&self, now: &Rational) -> bool {
        self.until > *now
    }

    pub(super) fn note_unexpected_event(&mut self) {
        self.is_outdated = true;
    }

    /// Keeps the forecast when the present plan is abandoned, with the steps that were started.
    pub(in crate::run) fn keep(&mut self, view: &RunView<'_>) {
        if self.abandoned.is_none() {
            self.abandoned = Some(AbandonedPlanState {
                steps: view.log.steps().clone(),
                was_as_anticipated: self.matches_forecast(view),
            });
        }
    }

    /// Returns `true` if a plan will be needed at `until`, in the same situation.
    pub(in crate::run) fn is_right(&self, until: &Rational, view: &RunView<'_>) -> bool {
        self.until == *until && self.matches_forecast(view)
    }

    /// Returns the foreseen situation if it is near and the execution was as foreseen. Small
    /// differences in time are permitted if plans are made in the background (`plans_in_background`).
    pub(in crate::run) fn for_request(
        self,
        guess: OverrunEstimate,
        view: &RunView<'_>,
        plans_in_background: bool,
    ) -> Option<AnticipatedSituation> {
        let PredictedState {
            situation, running, ..
        } = &self.prospect;
        let earliest = view.now + view.task.epsilon();
        let latest = &earliest + view.replanning_margin() + view.expected_planning_time;
        let is_near = (&earliest..=&latest).contains(&&situation.time);
        if !is_near || guess != OverrunEstimate::QuarterLonger {
            return None;
        }
        let (exactly, tickets) = view.situation_at(situation.time.clone(), guess);
        let is_guess = exactly != *situation || tickets != *running;
        let is_as_foreseen = !is_guess
            || plans_in_background
                && match &self.abandoned {
                    Some(left) => left.was_as_anticipated && !self.is_outdated,
                    None => self.matches_forecast(view),
                };
        is_as_foreseen.then(|| AnticipatedSituation {
            abandoned_steps: self.abandoned.map(|left| left.steps).unwrap_or_default(),
            prospect: self.prospect,
            since: self.since,
            is_approximate: is_guess,
        })
    }

    /// Returns `true` if, by the present forecast, the same actions will be running as was
    /// foreseen.
    fn matches_forecast(&self, view: &RunView<'_>) -> bool {
        let until = &self.until;
        let ends_by = (view.now + view.task.epsilon()).max(until.clone());
        let time = self.prospect.situation.time.clone();
        let anew = || anticipated_state(view, until, &ends_by, time);
        !self.is_outdated
            && anticipated_actions(&self.prospect, until, view)
                == anticipated_actions(&anew(), until, view)
    }
}

/// Returns the time at which a plan is needed if actions with a warning do not end.
pub(in crate::run) fn next_need(view: &RunView<'_>) -> Option<Rational> {
    let needs = view.log.open_tickets().filter_map(|ticket| {
        let entry = view.log.get(ticket)?;
        let window = view.executor.window(entry.step?, true)?.latest?;
        // If its slack has grown since then, another warning follows.
        let until = entry.warned.clone()?;
        (until >= window && until >= *view.now).then_some(until)
    });
    needs.min()
}

/// Returns the time at which an action becomes late that was expected to end before then.
pub(in crate::run) fn next_late_time(until: &Rational, view: &RunView<'_>) -> Option<Rational> {
    let doubts = view.belief.running().values().filter_map(|underway| {
        let planned = &underway.start + &underway.planned;
        let doubt = &planned + punctuality_tolerance() + view.task.epsilon();
        (planned <= *until && doubt > *view.now).then_some(doubt)
    });
    doubts.min()
}

fn anticipated_state(
    view: &RunView<'_>,
    until: &Rational,
    ends_by: &Rational,
    time: Rational,
) -> PredictedState {
    view.expected_situation(&PredictionHorizon {
        time,
        starts_before: until.clone(),
        ends_by: ends_by.clone(),
        late_actions: LateActionAssumption::Continues,
    })
}

/// Returns the actions that are foreseen to be running, except those that start or end at about
/// that time.
fn anticipated_actions(
    prospect: &PredictedState,
    until: &Rational,
    view: &RunView<'_>,
) -> BTreeSet<AnticipatedAction> {
    let slack = punctuality_tolerance();
    let is_about_then = |time: &Rational| *time >= until - &slack && *time <= until + &slack;
    let first = prospect.expected.first().map(|it| it.ticket);
    let running = prospect.running.iter().zip(&prospect.situation.running);
    let running = running.filter(|(_, it)| {
        let end = it.duration.lower.value();
        let end = end.map(|duration| &it.start + duration);
        !is_about_then(&it.start) && !end.is_some_and(|end| is_about_then(&end))
    });
    let doing = |ticket: ActionHandle| {
        if first.is_none_or(|first| ticket < first) {
            return Some(AnticipatedAction::Started(ticket));
        }
        let is_it = |it: &&ExpectedStart| it.ticket == ticket;
        let step = prospect.expected.iter().find(is_it)?.step;
        let started = view.log.ticket(step).map(AnticipatedAction::Started);
        Some(started.unwrap_or(AnticipatedAction::Upcoming(step)))
    };
    running.filter_map(|(ticket, _)| doing(*ticket)).collect()
}
