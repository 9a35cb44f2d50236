//! `guarded`: paper 1's executor DREEX.

use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{Constraint, DecoupledEnvelope, InstanceId, Valuation};

use super::{ExecutorEntry, Needs, Role, guarantee_status};
use crate::dispatch::{Dispatch, replan};
use crate::executor::{
    Decided, Decision, DecisionContext, Executor, PlanForm, Planned, PreparedPlan, StepId,
};
use crate::measured_amounts::{AmountEquation, amounts, duration_parameters};
use crate::reason::{Cause, GuaranteeLevel, Reason, Subject};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "guarded",
    argument: None,
    is_optional: false,
    summary: "Dispatches so that the plan works for all values inside its envelope, and replans as \
              soon as an observed quantity leaves its interval, a running action exceeds its upper \
              bound, or too little time is left. If only a start is late, it continues with a \
              smaller envelope, if there is one.",
    paper: "DREEX, Algorithm 2 in Cashmore et al. (2020)",
    needs: Needs::plan(PlanForm::Envelope),
    roles: &[Role::FirstPlan, Role::EarlyReplanning],
    make: |_, _| Box::new(Guarded { state: None }),
};

/// See [`REGISTERED`].
#[derive(Clone, Debug)]
struct Guarded {
    state: Option<GuardedPlan>,
}

#[derive(Clone, Debug)]
struct GuardedPlan {
    dispatch: Dispatch,
    prepared_plan: PreparedPlan,
    envelope: DecoupledEnvelope,
    /// The guarantee that dispatching maintains. It covers less than the envelope if the whole
    /// envelope would require knowing values in advance.
    guarantee: GuaranteeLevel,
    /// `true` if the plan's conditions are more than single facts, for example numeric.
    reads_more_than_facts: bool,
    /// The weakest promise with which the plan is continued.
    weakest_guarantee: GuaranteeLevel,
    /// The observed values, and nominal ones for the rest.
    values: Valuation,
}

impl Executor for Guarded {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let Some(envelope) = mission.envelope.clone() else {
            return Err(Box::new(
                Reason::new(Cause::GuaranteeLost).about(Subject::NoEnvelope),
            ));
        };
        let reading = |constraint: &Constraint| mission.plan.role(constraint, &envelope);
        let (dispatch, promise) = match Dispatch::with_contingent_durations(mission, &reading) {
            Ok(dispatch) => (dispatch, GuaranteeLevel::Envelope),
            Err(_) => guarantee_status::begin(mission)?,
        };
        self.state = Some(GuardedPlan {
            dispatch,
            guarantee: promise,
            weakest_guarantee: match promise {
                GuaranteeLevel::Envelope => GuaranteeLevel::PartOfEnvelope,
                _ => GuaranteeLevel::Luck,
            },
            values: mission.plan.nominal(),
            reads_more_than_facts: mission.plan.reads_more_than_facts(&mission.task),
            prepared_plan: mission.clone(),
            envelope,
        });
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let Some(guard) = &mut self.state else {
            return super::without_plan();
        };
        let trouble = guard.dispatch.process_news(moment);
        if let Some(reason) = trouble
            && let Some(reason) = guard.check_windows(moment.now, *reason)
        {
            return replan(*reason);
        }
        if let Some(reason) = guard.dispatch.overdue_reason(moment)
            && let Some(reason) = guard.check_windows(moment.now, reason)
        {
            return replan(*reason);
        }
        let amounts = amounts(&guard.prepared_plan.plan, moment);
        let outside = amounts
            .readings
            .iter()
            .find_map(|reading| guard.outside_interval(reading, moment.now));
        if let Some(reason) = outside {
            return replan(reason);
        }
        for deviation in &amounts.deviations {
            if let Some(reason) = guard.dispatch.unexpected_failure(moment, &deviation.fluent) {
                return replan(reason);
            }
        }
        let mut decided = guard.dispatch.next(moment);
        decided.reason.guarantee = match decided.decision {
            Decision::Start(_) | Decision::Wait { .. } => Some(guard.guarantee),
            _ => None,
        };
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.state.as_ref()?.dispatch.planned(step, is_end)
    }

    fn latest_tolerated_end(&self, step: StepId, now: &Rational) -> Option<Rational> {
        self.state
            .as_ref()?
            .latest_tolerated_end(step.instance(), now)
    }

    fn fork(&self) -> Option<Box<dyn Executor>> {
        Some(Box::new(self.clone()))
    }
}

impl GuardedPlan {
    /// Returns the latest end of a running action, beyond its present window, that does not require
    /// a new plan. It lies within the action's interval if the plan was adopted with its whole
    /// envelope.
    fn latest_tolerated_end(&self, instance: InstanceId, now: &Rational) -> Option<Rational> {
        let [start, _] = self.dispatch.start_and_end_nodes(instance);
        let begun = self.dispatch.execution_time(start)?;
        let mut durations = duration_parameters(&self.prepared_plan.plan);
        let own = durations.find(|(_, own)| *own == instance);
        let most = own.and_then(|(own, _)| self.envelope.interval(own).upper.value());
        let most = begun + most?;
        if self.weakest_guarantee == GuaranteeLevel::PartOfEnvelope {
            return self.dispatch.latest_tolerable_end(instance, &most, now);
        }
        let plan = (&self.prepared_plan, &self.values);
        let latest = guarantee_status::latest_tolerated_end(&self.dispatch, plan, instance, now)?;
        Some(latest.min(self.dispatch.to_world_time(&most)))
    }

    /// Returns the reason to abandon the plan if an event happened outside its window. The plan is
    /// continued if every quantity is still inside the envelope and one of two conditions holds:
    /// the dispatched network never covered the whole envelope, or a start is late. On a real clock
    /// all starts are a little late, which reduces the slack of later steps, and an envelope may
    /// use up all the slack there is.
    fn check_windows(&mut self, now: &Rational, reason: Reason) -> Option<Box<Reason>> {
        let local = self.dispatch.to_plan_time(now);
        let mut has_outlived = false;
        for (parameter, instance) in duration_parameters(&self.prepared_plan.plan) {
            let [start, end] = self.dispatch.start_and_end_nodes(instance);
            let Some(start) = self.dispatch.execution_time(start) else {
                continue;
            };
            if let Some(end) = self.dispatch.execution_time(end) {
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
        let was_whole = self.weakest_guarantee == GuaranteeLevel::PartOfEnvelope;
        let is_part = self.guarantee != GuaranteeLevel::Envelope;
        let is_borne =
            !was_whole || !has_outlived && (is_part || reason.cause == Cause::Unreachable);
        let stays_inside = self.envelope.contains(&self.values);
        if !stays_inside || !is_borne || !guarantee_status::is_time_violation(&reason) {
            return Some(Box::new(reason));
        }
        let rest = guarantee_status::RemainingPlan {
            prepared_plan: &self.prepared_plan,
            values: &self.values,
            is_inside: was_whole,
            reads_more_than_facts: self.reads_more_than_facts,
            guarantee: self.guarantee,
            has_other_constraints: false,
        };
        match guarantee_status::strongest_guarantee(&mut self.dispatch, &rest, now, reason.clone())
        {
            Ok(promise) if promise <= self.weakest_guarantee => {
                self.guarantee = promise.max(GuaranteeLevel::PartOfEnvelope);
                None
            }
            Ok(_) => Some(Box::new(reason)),
            Err(reason) => Some(reason),
        }
    }

    /// Returns the reason if a measured amount is outside its guaranteed interval.
    fn outside_interval(&self, reading: &AmountEquation, now: &Rational) -> Option<Reason> {
        let (about, observed, allowed) = if let Some((parameter, value)) = reading.value() {
            let name = self.prepared_plan.plan.parameter(parameter).name.clone();
            (
                Subject::Parameter(name),
                value,
                self.envelope.interval(parameter).clone(),
            )
        } else {
            let about = Subject::Change(reading.fluent.clone());
            (
                about,
                reading.observed.clone(),
                self.guaranteed_amounts(reading),
            )
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
    fn guaranteed_amounts(&self, reading: &AmountEquation) -> Interval {
        let mut amounts = Interval::point(reading.constant.clone());
        for (parameter, slope) in &reading.slopes {
            let interval = self.envelope.interval(*parameter);
            let (low, high) = (&interval.lower, &interval.upper);
            let (low, high) = if slope.is_negative() {
                (high, low)
            } else {
                (low, high)
            };
            amounts.lower = shifted_end(&amounts.lower, low, slope);
            amounts.upper = shifted_end(&amounts.upper, high, slope);
        }
        amounts
    }
}

/// Returns the end of an interval, moved by `slope` times another end.
fn shifted_end(end: &End, by: &End, slope: &Rational) -> End {
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
