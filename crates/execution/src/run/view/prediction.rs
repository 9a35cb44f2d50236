//! Forecast of the present plan's result.
//!
//! Running actions end, and steps start, in the order of the plan's network and as early as it
//! permits, but not before their planned times. So a delay affects only the successors of the late
//! action. A step whose conditions do not hold at its start is left out, with all steps that wait
//! for it.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body};
use elbowroom_model::{Situation, Step};
use elbowroom_num::{Interval, Rational};

use super::RunView;
use crate::belief_state::{BeliefState, RunningActionState};
use crate::event::ActionHandle;
use crate::executor::{PlanForm, StepId};
use crate::run::situation::{OverrunEstimate, quarter_longer_end, situation_at};
use crate::run::start_dependencies::StepEvent;

/// An expected start of the present plan.
#[derive(Clone, Debug)]
pub(in crate::run) struct ExpectedStart {
    /// Its ticket in the expected situation.
    pub(in crate::run) ticket: ActionHandle,
    pub(in crate::run) step: StepId,
    action: Arc<Action>,
    pub(in crate::run) start: Rational,
    pub(in crate::run) duration: Option<Rational>,
}

impl ExpectedStart {
    pub(in crate::run) fn as_step(&self, duration: Option<Rational>) -> Step {
        Step {
            action: Arc::clone(&self.action),
            start: self.start.clone(),
            duration,
        }
    }
}

/// Initial situation of a new plan.
#[derive(Clone, Debug)]
pub(in crate::run) struct PredictedState {
    pub(in crate::run) situation: Situation,
    /// The actions running there. Tickets that have not been issued yet are those of expected
    /// starts.
    pub(in crate::run) running: Vec<ActionHandle>,
    /// The expected starts until then.
    pub(in crate::run) expected: Vec<ExpectedStart>,
}

/// The range of a forecast.
pub(in crate::run) struct PredictionHorizon {
    /// The time of the forecast.
    pub(in crate::run) time: Rational,
    /// Steps that would start at this time or later are not expected to start.
    pub(in crate::run) starts_before: Rational,
    /// Actions that would end later than this are not expected to have ended.
    pub(in crate::run) ends_by: Rational,
    /// The assumption about overdue actions.
    pub(in crate::run) late_actions: LateActionAssumption,
}

/// Assumption about a running action that should have ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::run) enum LateActionAssumption {
    /// It takes a quarter longer than it has taken so far.
    QuarterLonger,
    /// It does not end. Only an action that is late by no more than [`punctuality_tolerance`] and has no
    /// warning ends now.
    Continues,
}

/// State of a forecast, advanced event by event.
struct ForecastState {
    belief: BeliefState,
    /// Expected times of the plan's coming starts and ends.
    times: BTreeMap<StepEvent, Rational>,
    /// The ends of the running actions.
    ends: Vec<(Rational, ActionHandle, Option<StepId>)>,
    to_come: Vec<ExpectedStart>,
    expected: Vec<ExpectedStart>,
}

/// Returns the delay that still counts as punctual, in seconds. On a real clock, no event is
/// punctual to the millisecond.
pub(in crate::run) fn punctuality_tolerance() -> Rational {
    Rational::new(1, 4)
}

impl RunView<'_> {
    /// Returns the expected situation when planning ends, or at `until`, if the present plan
    /// continues.
    pub(in crate::run) fn expected_situation_after_planning(
        &self,
        until: Option<&Rational>,
    ) -> PredictedState {
        let epsilon = self.task.epsilon();
        let expected_to_be_over = self.now + self.expected_planning_time + epsilon;
        let time = until.cloned().unwrap_or(expected_to_be_over);
        let before = &time - epsilon;
        self.expected_situation(&PredictionHorizon {
            time,
            starts_before: before.clone(),
            ends_by: before,
            late_actions: LateActionAssumption::QuarterLonger,
        })
    }

    /// Returns the expected situation if the present plan continues.
    pub(in crate::run) fn expected_situation(&self, reach: &PredictionHorizon) -> PredictedState {
        let mut future = self.initial_forecast(reach);
        while self.execute_next_event(&mut future, reach) {}
        let time = reach.time.clone();
        let (mut situation, running) =
            situation_at(&future.belief, time, OverrunEstimate::QuarterLonger);
        if reach.late_actions == LateActionAssumption::QuarterLonger {
            // The quarter is measured from now, not from the time of the forecast.
            for (ticket, it) in running.iter().zip(&mut situation.running) {
                let underway = self.belief.running().get(ticket);
                let end = underway.filter(|it| self.is_due(it));
                let end = end.and_then(|it| self.expected_end(*ticket, it, reach.late_actions));
                if let Some(end) = end.filter(|end| *end > situation.time) {
                    it.duration = Interval::point(end - &it.start);
                }
            }
        }
        PredictedState {
            situation,
            running,
            expected: future.expected,
        }
    }

    fn initial_forecast(&self, reach: &PredictionHorizon) -> ForecastState {
        let mut belief = self.belief.clone();
        let _ = belief.advance(self.now);
        let mut ends = Vec::new();
        for (ticket, underway) in self.belief.running() {
            if let Some(end) = self.expected_end(*ticket, underway, reach.late_actions) {
                let entry = self.log.get(*ticket);
                ends.push((end, *ticket, entry.and_then(|entry| entry.step)));
            }
        }
        // Commanded actions whose start was not reported are assumed to start now.
        for ticket in self.log.open_tickets() {
            let entry = self.log.get(ticket);
            let Some(entry) = entry.filter(|entry| entry.started.is_none()) else {
                continue;
            };
            let duration = entry.planned.clone().unwrap_or_default();
            if let Some(begun) =
                belief_after_start(&belief, ticket, &entry.action, self.now, &duration)
            {
                belief = begun;
                ends.push((self.now + duration, ticket, entry.step));
            }
        }
        ForecastState {
            belief,
            times: BTreeMap::new(),
            ends,
            to_come: self.upcoming_steps(&reach.starts_before),
            expected: Vec::new(),
        }
    }

    /// Returns `true` if it should have ended.
    fn is_due(&self, underway: &RunningActionState) -> bool {
        &underway.start + &underway.planned <= *self.now
    }

    /// Returns the expected end of a running action; `None` if it is not expected to end.
    fn expected_end(
        &self,
        ticket: ActionHandle,
        underway: &RunningActionState,
        late: LateActionAssumption,
    ) -> Option<Rational> {
        let planned = &underway.start + &underway.planned;
        if !self.is_due(underway) {
            return Some(planned);
        }
        let soonest = self.now + self.task.epsilon();
        match late {
            LateActionAssumption::QuarterLonger => {
                Some(quarter_longer_end(self.belief, ticket, self.now).max(soonest))
            }
            LateActionAssumption::Continues => {
                let entry = self.log.get(ticket);
                let was_warned_of = entry.is_some_and(|entry| entry.warned.is_some());
                let is_on_time = planned + punctuality_tolerance() >= *self.now;
                (is_on_time && !was_warned_of).then_some(soonest)
            }
        }
    }

    /// Returns the steps of the present plan that have not started and may start before some time,
    /// with their earliest times. Their tickets are not chosen yet.
    fn upcoming_steps(&self, before: &Rational) -> Vec<ExpectedStart> {
        // These executors choose their own step numbers.
        if self.executor.need() == PlanForm::PartialOrder {
            return Vec::new();
        }
        let steps = self.log.plan_steps().iter();
        let left =
            steps.filter(|(id, step)| step.start < *before && self.log.ticket(*id).is_none());
        let soonest = self.now + self.task.epsilon();
        let left = left.map(|(id, step)| {
            let window = self.executor.window(*id, false);
            let earliest = window.and_then(|window| window.earliest);
            let start = step.start.clone().max(soonest.clone());
            ExpectedStart {
                ticket: ActionHandle(0),
                step: *id,
                action: Arc::clone(&step.action),
                start: earliest.map_or(start.clone(), |earliest| earliest.max(start)),
                duration: step.duration.clone(),
            }
        });
        let mut left: Vec<ExpectedStart> = left.collect();
        // Among steps that can start at the same time, the first one planned comes first.
        left.sort_by(|one, other| one.start.cmp(&other.start));
        left
    }

    /// Returns the earliest start of a step, if all its predecessors have happened.
    fn start_in(&self, future: &ForecastState, it: &ExpectedStart) -> Option<Rational> {
        let mut start = it.start.clone().max(future.belief.time().clone());
        for wait in self.log.waits(it.step) {
            let expected = future.times.get(&wait.event);
            let happened = expected.or_else(|| self.log.time_of(wait.event))?;
            start = start.max(happened + &wait.min_delay);
        }
        Some(start)
    }

    /// Executes the next event of the forecast. Returns `false` if there is none.
    fn execute_next_event(&self, future: &mut ForecastState, reach: &PredictionHorizon) -> bool {
        let starts = future.to_come.iter();
        let starts = starts
            .take_while(|it| it.start < reach.starts_before)
            .enumerate()
            .filter_map(|(index, it)| Some((self.start_in(future, it)?, index)))
            .filter(|(time, _)| *time < reach.starts_before);
        let starts: Vec<(Rational, usize)> = starts.collect();
        let start = starts.iter().map(|(time, _)| time).min().cloned();
        let ends = future.ends.iter().enumerate();
        let ends = ends.filter(|(_, (time, ..))| *time <= reach.ends_by);
        let end = ends.min_by(|(_, one), (_, other)| one.cmp(other));
        // Ends come before starts, because starts may need the effects of ends.
        let end = end.filter(|(_, (time, ..))| start.as_ref().is_none_or(|start| time <= start));
        if let Some((index, _)) = end {
            let (time, ticket, step) = future.ends.swap_remove(index);
            // Effects that cannot be computed are ignored, since the forecast is not a guarantee.
            let _ = future.belief.advance_for_happening(&time);
            let _ = future.belief.end(ticket, &[]);
            if let Some(step) = step {
                future.times.insert((step, true), time);
            }
            return true;
        }
        let Some(time) = start else {
            return false;
        };
        let now = starts.iter().filter(|(start, _)| *start == time);
        let now: Vec<usize> = now.map(|(_, index)| *index).collect();
        let ticket = ActionHandle(self.log.started() as u64 + future.expected.len() as u64);
        for index in &now {
            let it = &future.to_come[*index];
            let duration = it.duration.clone().unwrap_or_default();
            if let Some(begun) =
                belief_after_start(&future.belief, ticket, &it.action, &time, &duration)
            {
                future.belief = begun;
                let it = future.to_come.remove(*index);
                future.start(it, ticket, time);
                return true;
            }
        }
        // None of these steps can start.
        for index in now.into_iter().rev() {
            future.to_come.remove(index);
        }
        true
    }
}

impl ForecastState {
    /// Records the expected start of a step.
    fn start(&mut self, it: ExpectedStart, ticket: ActionHandle, time: Rational) {
        match &it.duration {
            Some(duration) => self.ends.push((&time + duration, ticket, Some(it.step))),
            None => drop(self.times.insert((it.step, true), time.clone())),
        }
        self.times.insert((it.step, false), time.clone());
        self.expected.push(ExpectedStart {
            ticket,
            start: time,
            ..it
        });
    }
}

/// Returns the belief after the start of an action; `None` if its conditions do not hold.
fn belief_after_start(
    belief: &BeliefState,
    ticket: ActionHandle,
    action: &Arc<Action>,
    time: &Rational,
    duration: &Rational,
) -> Option<BeliefState> {
    let mut belief = belief.clone();
    let _ = belief.advance_for_happening(time);
    let (condition, planned) = match &action.body {
        Body::Instantaneous(snap) => (&snap.condition, None),
        Body::Durative(body) => (&body.start.condition, Some(duration)),
    };
    if belief.holds_on_arrival(condition, planned) != Ok(true) {
        return None;
    }
    let _ = belief.start(ticket, action, duration, &[]);
    let breaks = belief.failing_actions().iter().any(|(it, _)| *it == ticket);
    (!breaks).then_some(belief)
}
