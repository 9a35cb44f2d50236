//! Comparison of observations with the envelope. While all observations lie within the plan's
//! envelope, the remaining plan works, and no query of the region is needed: the dispatched network
//! keeps a feasible schedule, and the envelope guarantees the numeric conditions. Once an
//! observation has left the envelope, a new box is computed that serves the same purpose for the
//! remaining plan.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_model::problem::Unknown;
use elbowroom_num::{End, Rational};
use elbowroom_plan::{DecoupledEnvelope, InstanceId, ParameterId, ParameterKind};
use elbowroom_stn::ConsistentNetwork;

use super::ExecutedPlan;
use crate::executor::DecisionContext;
use crate::measured_amounts::{amount_expression, amount_locations};
use crate::preparation::RegionOracle;
use crate::reason::{GuaranteeLevel, Reason};

/// The box of the remaining plan, and the observations compared with it.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxMembership {
    /// The box computed for the remaining plan after an observation left the plan's envelope.
    /// `None` as long as the plan's envelope applies.
    plan_box: Option<DecoupledEnvelope>,
    /// `true` if a later observation lies outside the box, or is not covered by it.
    has_left_box: bool,
    /// Parameters whose amounts were observed since then.
    amounts: BTreeSet<ParameterId>,
    /// The times, on the plan's clock, at which running actions will have reached their longest
    /// durations in the box: by action, and sorted by time.
    ends: BTreeMap<InstanceId, Rational>,
    due: BTreeSet<(Rational, InstanceId)>,
}

impl BoxMembership {
    /// Records an observation that the box does not cover.
    pub(super) fn mark_left(&mut self) {
        self.has_left_box = true;
    }

    /// Sets the time at which an action reaches its longest duration in the box; `None` if it is
    /// over, or has no such time.
    fn set_due(&mut self, instance: InstanceId, time: Option<Rational>) {
        if let Some(old) = self.ends.remove(&instance) {
            self.due.remove(&(old, instance));
        }
        if let Some(time) = time {
            self.due.insert((time.clone(), instance));
            self.ends.insert(instance, time);
        }
    }

    /// Returns the actions that have reached their longest durations in the box by this time, on
    /// the plan's clock, with the times of that.
    fn due_by(&self, local: &Rational) -> impl Iterator<Item = &(Rational, InstanceId)> {
        self.due.iter().take_while(move |(time, _)| time <= local)
    }
}

impl ExecutedPlan {
    /// Begins with a plan, which may have running actions.
    pub(super) fn begin(&mut self, region: &mut dyn RegionOracle) {
        self.schedule_running_limits();
        let now = self.prepared_plan.now.clone();
        if !self.is_covered(&now, region) {
            self.find_limits(&now, region);
        }
    }

    /// Returns the box of values for which the remaining plan is known to work, if there is one.
    fn known_box(&self) -> Option<&DecoupledEnvelope> {
        let found = self.box_membership.plan_box.as_ref();
        found.or(self.prepared_plan.envelope.as_ref())
    }

    /// Returns `true` if there is a box of values for which the remaining plan is known to work.
    pub(super) fn has_box(&self) -> bool {
        self.known_box().is_some()
    }

    /// Replaces the box of the remaining plan.
    pub(super) fn set_box(&mut self, found: DecoupledEnvelope) {
        self.box_membership = BoxMembership {
            plan_box: Some(found),
            ..BoxMembership::default()
        };
        self.limits.clear();
        self.schedule_running_limits();
    }

    /// Records when the running actions will have reached their longest durations in the box.
    fn schedule_running_limits(&mut self) {
        let running: Vec<InstanceId> = self.dispatch.running().iter().copied().collect();
        for instance in running {
            self.observe_duration(instance);
        }
    }

    /// Records the duration of an action that has ended, or the longest duration in the box of one
    /// that has started.
    pub(super) fn observe_duration(&mut self, instance: InstanceId) {
        let [start, end] = self.dispatch.start_and_end_nodes(instance);
        let Some(start) = self.dispatch.execution_time(start).cloned() else {
            return;
        };
        let duration = self.dispatch.execution_time(end).map(|end| end - &start);
        if duration.is_some() {
            self.limits.remove(&instance);
        }
        let Some(&parameter) = self.durations.get(&instance) else {
            return;
        };
        let interval = self.known_box().map(|known| known.interval(parameter));
        // An open end counts like a closed one: in neither case is the action allowed to exceed it.
        let most = interval.and_then(|interval| match &interval.upper {
            End::Closed(most) | End::Open(most) => Some(most),
            End::Infinite => None,
        });
        let due = most.map(|most| start + most);
        if let Some(duration) = duration {
            let is_held = interval.is_some_and(|interval| interval.contains(&duration));
            self.box_membership.has_left_box |= !is_held;
            self.box_membership.set_due(instance, None);
            self.values[parameter] = duration;
        } else {
            let is_running = self.dispatch.running().contains(&instance);
            self.box_membership
                .set_due(instance, due.filter(|_| is_running));
        }
    }

    /// Records a measured amount that determines the value of one parameter.
    pub(super) fn observe_amount(&mut self, parameter: ParameterId, value: &Rational) {
        let interval = self.known_box().map(|known| known.interval(parameter));
        let is_held = interval.is_some_and(|interval| interval.contains(value));
        let is_new = self.box_membership.amounts.insert(parameter);
        // Two different amounts cannot come from one value of a parameter.
        self.box_membership.has_left_box |= !is_held || !is_new && self.values[parameter] != *value;
    }

    /// Records start amounts that were measured before the durations of their actions were known.
    /// The envelope does not cover amounts that depend on durations.
    pub(super) fn observe_early_amounts(&mut self, moment: &DecisionContext<'_>) {
        let depends = amount_locations(moment.plan_events).any(|place| {
            !place.is_end && self.depends_on_duration(place.instance, place.amount.measured.fluent)
        });
        self.box_membership.has_left_box |= depends;
    }

    /// Returns `true` if an action's start effect on a number depends on the action's duration.
    fn depends_on_duration(&self, instance: InstanceId, fluent: FluentId) -> bool {
        let plan = &self.prepared_plan.plan;
        let action = &plan.plan.instance(instance).action;
        let is_duration = |index: u32| {
            let parameter = plan.parameters.get(index as usize);
            parameter.is_some_and(|own| matches!(own.kind, ParameterKind::Duration(_)))
        };
        let mut depends = false;
        if let Some(expression) = amount_expression(action, false, fluent) {
            expression.visit_leaves(&mut |leaf| {
                depends |= match leaf {
                    Expression::Duration => true,
                    Expression::Unknown(Unknown::Parameter(index)) => is_duration(*index),
                    _ => false,
                };
            });
        }
        depends
    }

    /// Checks the observed times after an event that the plan did not permit. If the plan's
    /// constraints cannot be satisfied with the observed values, the execution is no longer one of
    /// the plan's schedules, and the box does not apply any more.
    pub(super) fn check_observed_times(&mut self, now: &Rational) {
        if self.box_membership.has_left_box || !self.reads_more_than_facts {
            return;
        }
        let (plan, values) = self.remaining_plan(now);
        let network = ConsistentNetwork::try_from(plan.plan.network(&values));
        self.box_membership.has_left_box |= network.is_err();
    }

    /// Returns `true` if the remaining plan works without a query of the region, as long as running
    /// actions end within the box. This holds if all observations lie within the box and a schedule
    /// for the remaining plan exists. The dispatched network guarantees a schedule for all
    /// durations it was prepared for, except with [`GuaranteeLevel::Luck`].
    pub(super) fn is_covered(&self, now: &Rational, region: &dyn RegionOracle) -> bool {
        let local = self.dispatch.to_plan_time(now);
        let mut due = self.box_membership.due_by(&local);
        !region.is_asked_inside()
            && self.has_box()
            && self.guarantee != GuaranteeLevel::Luck
            && !self.box_membership.has_left_box
            && due.all(|(time, _)| *time == local)
    }

    /// Returns `true` if a running action has taken longer than the box permits.
    pub(super) fn has_running_action_left_box(&self, now: &Rational) -> bool {
        let local = self.dispatch.to_plan_time(now);
        let first = self.box_membership.due.first();
        first.is_some_and(|(time, _)| *time < local)
    }

    /// Handles actions that have reached their longest durations in the box: queries the region for
    /// the remaining plan, and computes how long actions may still take that have no slack in the
    /// new box. Returns the reason if the remaining plan does not work.
    pub(super) fn handle_reached_limits(
        &mut self,
        now: &Rational,
        region: &mut dyn RegionOracle,
    ) -> Option<Box<Reason>> {
        let (time, instance) = self.first_due(now)?;
        let then = self.dispatch.to_world_time(&time);
        let was_covered = self.is_covered(&then, region);
        if then < *now || !was_covered {
            let reason = self.query_region(instance, now, region);
            if was_covered && reason.is_some() {
                // The plan worked with the earlier end, so there is a limit in between.
                self.find_limit(instance, &then, region);
                return reason.filter(|_| self.check_limits(now).is_none());
            }
            if reason.is_some() {
                return reason;
            }
        }
        while let Some((_, instance)) = self.first_due(now) {
            self.find_limit(instance, now, region);
        }
        None
    }

    /// Returns the first running action without a computed limit that will have reached its longest
    /// duration in the box by `by`, and the time of that on the plan's clock.
    fn first_due(&self, by: &Rational) -> Option<(Rational, InstanceId)> {
        let local = self.dispatch.to_plan_time(by);
        let due = self.next_due()?;
        (due.0 <= local).then(|| due.clone())
    }

    /// Returns the time, on the plan's clock, at which the first running action without a computed
    /// limit reaches its longest duration in the box.
    pub(super) fn next_due(&self) -> Option<&(Rational, InstanceId)> {
        if !self.durations_move_numbers {
            return None;
        }
        let mut due = self.box_membership.due.iter();
        due.find(|(_, instance)| !self.limits.contains_key(instance))
    }
}
