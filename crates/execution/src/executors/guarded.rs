//! `guarded`: paper 1's executor DREEX.

use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{Constraint, DecoupledEnvelope, InstanceId, Valuation};

use super::{Registered, promise};
use crate::dispatch::{Dispatch, replan};
use crate::executor::{CAN_HAVE_A_CLOCK, Need};
use crate::executor::{Decided, Decision, Executor, Mission, Moment, Planned, StepId};
use crate::quantities::{Reading, amounts, duration_parameters};
use crate::reason::{About, Cause, Promise, Reason};

pub(super) const REGISTERED: Registered = Registered {
    name: "guarded",
    argument: None,
    is_optional: false,
    summary: "Dispatches so that the plan works whatever happens within its envelope, and replans as \
              soon as an observed quantity leaves its interval, a running action outlives its \
              upper end, or too little time is left. Where only a start is late, it goes on with a \
              smaller envelope, if there is one.",
    paper: "DREEX, Algorithm 2 in Cashmore et al. (2020)",
    need: Need::Envelope,
    make: |_, _| Box::new(Guarded { state: None }),
};

/// See [`REGISTERED`].
#[derive(Clone, Debug)]
struct Guarded {
    state: Option<Guard>,
}

#[derive(Clone, Debug)]
struct Guard {
    dispatch: Dispatch,
    mission: Mission,
    envelope: DecoupledEnvelope,
    /// The guarantee that dispatching maintains. It covers less than the envelope if the whole
    /// envelope would require knowing values in advance.
    promise: Promise,
    /// `true` if the plan's conditions are more than single facts, for example numeric.
    reads_more_than_facts: bool,
    /// The weakest promise with which the plan is continued.
    least: Promise,
    /// The observed values, and nominal ones for the rest.
    values: Valuation,
}

impl Executor for Guarded {
    fn need(&self) -> Need {
        REGISTERED.need
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let Some(envelope) = mission.envelope.clone() else {
            return Err(Box::new(
                Reason::new(Cause::GuaranteeLost).about(About::NoEnvelope),
            ));
        };
        let reading = |constraint: &Constraint| mission.plan.reading(constraint, &envelope);
        let (dispatch, promise) = match Dispatch::controlled(mission, &reading) {
            Ok(dispatch) => (dispatch, Promise::Envelope),
            Err(_) => promise::begin(mission)?,
        };
        self.state = Some(Guard {
            dispatch,
            promise,
            least: match promise {
                Promise::Envelope => Promise::PartOfEnvelope,
                _ => Promise::Luck,
            },
            values: mission.plan.nominal(),
            reads_more_than_facts: mission.plan.reads_more_than_facts(&mission.task),
            mission: mission.clone(),
            envelope,
        });
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let Some(guard) = &mut self.state else {
            return super::without_plan();
        };
        let trouble = guard.dispatch.take(moment);
        if let Some(reason) = trouble
            && let Some(reason) = guard.outlast(moment.now, *reason)
        {
            return replan(*reason);
        }
        if let Some(reason) = guard.dispatch.overdue(moment)
            && let Some(reason) = guard.outlast(moment.now, reason)
        {
            return replan(*reason);
        }
        let amounts = amounts(&guard.mission.plan, moment);
        let outside = amounts
            .readings
            .iter()
            .find_map(|reading| guard.outside(reading, moment.now));
        if let Some(reason) = outside {
            return replan(reason);
        }
        for deviation in &amounts.deviations {
            if let Some(reason) = guard.dispatch.surprise(moment, &deviation.fluent) {
                return replan(reason);
            }
        }
        let mut decided = guard.dispatch.next(moment);
        decided.reason.promise = match decided.decision {
            Decision::Start(_) | Decision::Wait { .. } => Some(guard.promise),
            _ => None,
        };
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.state.as_ref()?.dispatch.planned(step, is_end)
    }

    fn bears_until(&self, step: StepId, now: &Rational) -> Option<Rational> {
        let guard = self.state.as_ref().filter(|_| CAN_HAVE_A_CLOCK)?;
        guard.bears_until(step.instance(), now)
    }

    fn fork(&self) -> Option<Box<dyn Executor>> {
        Some(Box::new(self.clone()))
    }
}

impl Guard {
    /// Returns the latest end of a running action, beyond its present window, that does not require
    /// a new plan. It lies within the action's interval if the plan was adopted with its whole
    /// envelope.
    fn bears_until(&self, instance: InstanceId, now: &Rational) -> Option<Rational> {
        let [start, _] = self.dispatch.nodes_of(instance);
        let begun = self.dispatch.happened(start)?;
        let mut durations = duration_parameters(&self.mission.plan);
        let own = durations.find(|(_, own)| *own == instance);
        let most = own.and_then(|(own, _)| self.envelope.interval(own).upper.value());
        let most = begun + most?;
        if self.least == Promise::PartOfEnvelope {
            return self.dispatch.prolongable(instance, &most, now);
        }
        let plan = (&self.mission, &self.values);
        let latest = promise::bears_until(&self.dispatch, plan, instance, now)?;
        Some(latest.min(self.dispatch.world(&most)))
    }

    /// Returns the reason to abandon the plan if an event happened outside its window. The plan is
    /// continued if every quantity is still inside the envelope and one of two conditions holds:
    /// the dispatched network never covered the whole envelope, or a start is late. On a real clock
    /// all starts are a little late, which reduces the slack of later steps, and an envelope may
    /// use up all the slack there is.
    fn outlast(&mut self, now: &Rational, reason: Reason) -> Option<Box<Reason>> {
        let local = self.dispatch.local(now);
        let mut has_outlived = false;
        for (parameter, instance) in duration_parameters(&self.mission.plan) {
            let [start, end] = self.dispatch.nodes_of(instance);
            let Some(start) = self.dispatch.happened(start) else {
                continue;
            };
            if let Some(end) = self.dispatch.happened(end) {
                self.values[parameter] = end - start;
            } else {
                let elapsed = &local - start;
                has_outlived |= match &self.envelope.interval(parameter).upper {
                    End::Closed(most) => elapsed > *most,
                    End::Open(most) => elapsed >= *most,
                    End::Infinite => false,
                };
            }
        }
        let was_whole = self.least == Promise::PartOfEnvelope;
        let is_part = self.promise != Promise::Envelope;
        let is_borne =
            !was_whole || !has_outlived && (is_part || reason.cause == Cause::Unreachable);
        let stays_inside = self.envelope.contains(&self.values);
        if !stays_inside || !is_borne || !promise::is_about_time(&reason) {
            return Some(Box::new(reason));
        }
        let rest = promise::Rest {
            mission: &self.mission,
            values: &self.values,
            is_inside: was_whole,
            reads_more_than_facts: self.reads_more_than_facts,
            promise: self.promise,
            has_other_constraints: false,
        };
        match promise::weaken(&mut self.dispatch, &rest, now, reason.clone()) {
            Ok(promise) if promise <= self.least => {
                self.promise = promise.max(Promise::PartOfEnvelope);
                None
            }
            Ok(_) => Some(Box::new(reason)),
            Err(reason) => Some(reason),
        }
    }

    /// Returns the reason if a measured amount is outside its guaranteed interval.
    fn outside(&self, reading: &Reading, now: &Rational) -> Option<Reason> {
        let (about, observed, allowed) = if let Some((parameter, value)) = reading.value() {
            let name = self.mission.plan.parameter(parameter).name.clone();
            (
                About::Parameter(name),
                value,
                self.envelope.interval(parameter).clone(),
            )
        } else {
            let about = About::Change(reading.fluent.clone());
            (about, reading.observed.clone(), self.guaranteed(reading))
        };
        if allowed.contains(&observed) {
            return None;
        }
        let mut reason = Reason::new(Cause::OutsideInterval).about(about);
        reason.action = Some(reading.action.clone());
        let below = allowed.lower.value().map(|lower| lower - &observed);
        let above = allowed.upper.value().map(|upper| &observed - upper);
        reason.by = below.into_iter().chain(above).max();
        reason.observed = Some(observed);
        reason.allowed = Some(allowed);
        Some(reason.since(now.clone()))
    }

    /// Returns the amounts that are possible while all of their parameters lie in their intervals.
    /// The values of the individual parameters are unknown, but the guarantee only requires that
    /// such values exist.
    fn guaranteed(&self, reading: &Reading) -> Interval {
        let mut amounts = Interval::point(reading.constant.clone());
        for (parameter, slope) in &reading.slopes {
            let interval = self.envelope.interval(*parameter);
            let (low, high) = (&interval.lower, &interval.upper);
            let (low, high) = if slope.is_negative() {
                (high, low)
            } else {
                (low, high)
            };
            amounts.lower = moved(&amounts.lower, low, slope);
            amounts.upper = moved(&amounts.upper, high, slope);
        }
        amounts
    }
}

/// Returns the end of an interval, moved by `slope` times another end.
fn moved(end: &End, by: &End, slope: &Rational) -> End {
    match (end.value(), by.value()) {
        (Some(value), Some(by_value)) => {
            let sum = value + by_value * slope;
            match (end, by) {
                (End::Closed(_), End::Closed(_)) => End::Closed(sum),
                _ => End::Open(sum),
            }
        }
        _ => End::Infinite,
    }
}
