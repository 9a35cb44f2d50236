//! Longest durations of running actions for which the numeric conditions of the remaining plan
//! hold.

use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{InstanceId, ParametrizedPlan, Valuation};

use super::{ExecutedPlan, parameter_bounds};
use crate::executor::{Decided, Decision};
use crate::preparation::RegionOracle;
use crate::reason::{Cause, Reason, Subject};

impl ExecutedPlan {
    /// Computes how long each running action may take, as far as numbers depend on it.
    pub(super) fn find_limits(&mut self, now: &Rational, region: &mut dyn RegionOracle) {
        self.limits.clear();
        if !self.durations_move_numbers || self.dispatch.running().is_empty() {
            return;
        }
        let (plan, values) = self.remaining_plan(now);
        let running: Vec<InstanceId> = self.dispatch.running().iter().copied().collect();
        for instance in running {
            self.find_limit_in(instance, (&plan, &values), region);
        }
    }

    /// Computes how long a running action may take, as far as numbers depend on it.
    pub(super) fn find_limit(
        &mut self,
        instance: InstanceId,
        now: &Rational,
        region: &mut dyn RegionOracle,
    ) {
        let (plan, values) = self.remaining_plan(now);
        self.find_limit_in(instance, (&plan, &values), region);
    }

    fn find_limit_in(
        &mut self,
        instance: InstanceId,
        (plan, values): (&ParametrizedPlan, &Valuation),
        region: &mut dyn RegionOracle,
    ) {
        let Some(&parameter) = self.durations.get(&instance) else {
            return;
        };
        let mut does = region.growing(&self.prepared_plan.task, plan, values, parameter);
        let least = &values[parameter];
        let (_, most) = parameter_bounds(&self.prepared_plan.plan, parameter);
        let limit = greatest_duration(
            least,
            most.as_ref(),
            self.prepared_plan.task.epsilon(),
            &mut does,
        );
        drop(does);
        self.limits.insert(instance, limit);
    }

    /// Returns the time at which a running action reaches its limit, on the plan's clock.
    pub(super) fn limit_time(&self, instance: InstanceId, limit: &Rational) -> Option<Rational> {
        let [start, end] = self.dispatch.start_and_end_nodes(instance);
        let start = self.dispatch.execution_time(start)?;
        let has_ended = self.dispatch.execution_time(end).is_some();
        (!has_ended).then(|| start + limit)
    }

    /// Returns the reason if a running action has taken longer than the numeric conditions permit.
    pub(super) fn check_limits(&self, now: &Rational) -> Option<Reason> {
        let local = self.dispatch.to_plan_time(now);
        let mut limits = self.limits.iter();
        limits.find_map(|(instance, limit)| {
            let limit = limit.as_ref()?;
            let time = self.limit_time(*instance, limit)?;
            if time >= local {
                return None;
            }
            let action = &self.dispatch.action(*instance).name;
            let mut reason = Reason::new(Cause::Outlived)
                .for_action(action)
                .about(Subject::NumericConditionsWhenLonger);
            reason.observed = Some(&local - &time + limit);
            reason.allowed = Some(Interval::closed(Rational::ZERO, limit.clone()));
            reason.by = Some(&local - &time);
            Some(reason.since(self.dispatch.to_world_time(&time)))
        })
    }

    /// Ends a wait when an action reaches its limit.
    pub(super) fn limit_wait(&self, decided: Decided) -> Decided {
        let Decision::Wait { until } = &decided.decision else {
            return decided;
        };
        let next_due = self.next_due();
        let due = next_due
            .map(|(time, _)| self.dispatch.to_world_time(time) + self.prepared_plan.task.epsilon());
        let until = self
            .time_after_first_limit()
            .into_iter()
            .chain(due)
            .chain(until.clone())
            .min();
        Decided {
            decision: Decision::Wait { until },
            ..decided
        }
    }

    /// Returns the time ε after the first limit of a running action.
    pub(super) fn time_after_first_limit(&self) -> Option<Rational> {
        let limits = self.limits.iter();
        let times = limits.filter_map(|(instance, limit)| {
            let time = self.limit_time(*instance, limit.as_ref()?)?;
            Some(self.dispatch.to_world_time(&time) + self.prepared_plan.task.epsilon())
        });
        times.min()
    }
}

/// Longest extension of a duration that is examined, as a multiple of the duration (of 1 s if it is
/// shorter).
const MAX_EXTENSION_FACTOR: i64 = 1_000_000;

/// Returns the greatest duration for which `does` holds, up to `epsilon`. `None` if it holds up to
/// `most`, or up to the longest duration examined. It must hold for `least`. With disjunctive
/// conditions there may be a gap; the search ends before the gap.
fn greatest_duration(
    least: &Rational,
    most: Option<&Rational>,
    epsilon: &Rational,
    does: &mut dyn FnMut(&Rational) -> bool,
) -> Option<Rational> {
    let unit = least.clone().max(Rational::ONE);
    let far = least + &unit * Rational::from(MAX_EXTENSION_FACTOR);
    let far = most.map_or(far.clone(), |most| most.clone().min(far));
    if far <= *least || does(&far) {
        return None;
    }
    let two = Rational::from(2);
    let mut good = least.clone();
    let mut bad = far;
    let mut step = unit;
    while &good + &step < bad {
        let next = &good + &step;
        if does(&next) {
            good = next;
            step *= &two;
        } else {
            bad = next;
        }
    }
    while &bad - &good > *epsilon {
        let middle = (&good + &bad) / &two;
        if does(&middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Some(good)
}
