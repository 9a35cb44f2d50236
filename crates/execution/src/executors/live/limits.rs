//! Longest durations of running actions for which the numeric conditions of the remaining plan
//! hold.

use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{InstanceId, ParametrizedPlan, Valuation};

use super::{Rest, range};
use crate::executor::{Decided, Decision};
use crate::preparation::Region;
use crate::reason::{About, Cause, Reason};

impl Rest {
    /// Computes how long each running action may take, as far as numbers depend on it.
    pub(super) fn find_limits(&mut self, now: &Rational, region: &mut dyn Region) {
        self.limits.clear();
        if !self.durations_move_numbers || self.dispatch.running().is_empty() {
            return;
        }
        let (plan, values) = self.remainder(now);
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
        region: &mut dyn Region,
    ) {
        let (plan, values) = self.remainder(now);
        self.find_limit_in(instance, (&plan, &values), region);
    }

    fn find_limit_in(
        &mut self,
        instance: InstanceId,
        (plan, values): (&ParametrizedPlan, &Valuation),
        region: &mut dyn Region,
    ) {
        let Some(&parameter) = self.durations.get(&instance) else {
            return;
        };
        let mut does = region.growing(&self.mission.task, plan, values, parameter);
        let least = &values[parameter];
        let (_, most) = range(&self.mission.plan, parameter);
        let limit = greatest(least, most.as_ref(), self.mission.task.epsilon(), &mut does);
        drop(does);
        self.limits.insert(instance, limit);
    }

    /// Returns the time at which a running action reaches its limit, on the plan's clock.
    pub(super) fn limit_of(&self, instance: InstanceId, limit: &Rational) -> Option<Rational> {
        let [start, end] = self.dispatch.nodes_of(instance);
        let start = self.dispatch.happened(start)?;
        let has_ended = self.dispatch.happened(end).is_some();
        (!has_ended).then(|| start + limit)
    }

    /// Returns the reason if a running action has taken longer than the numeric conditions permit.
    pub(super) fn outlived(&self, now: &Rational) -> Option<Reason> {
        let local = self.dispatch.local(now);
        let mut limits = self.limits.iter();
        limits.find_map(|(instance, limit)| {
            let limit = limit.as_ref()?;
            let time = self.limit_of(*instance, limit)?;
            if time >= local {
                return None;
            }
            let action = &self.dispatch.action(*instance).name;
            let mut reason = Reason::new(Cause::Outlived)
                .of(action)
                .about(About::LaterNumbers);
            reason.observed = Some(&local - &time + limit);
            reason.allowed = Some(Interval::closed(Rational::ZERO, limit.clone()));
            reason.by = Some(&local - &time);
            Some(reason.since(self.dispatch.world(&time)))
        })
    }

    /// Ends a wait when an action reaches its limit.
    pub(super) fn waking(&self, decided: Decided) -> Decided {
        let Decision::Wait { until } = &decided.decision else {
            return decided;
        };
        let next_due = self.next_due();
        let due = next_due.map(|(time, _)| self.dispatch.world(time) + self.mission.task.epsilon());
        let until = self
            .after_limit()
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
    pub(super) fn after_limit(&self) -> Option<Rational> {
        let limits = self.limits.iter();
        let times = limits.filter_map(|(instance, limit)| {
            let time = self.limit_of(*instance, limit.as_ref()?)?;
            Some(self.dispatch.world(&time) + self.mission.task.epsilon())
        });
        times.min()
    }
}

/// Longest extension of a duration that is examined, as a multiple of the duration (of 1 s if it is
/// shorter).
const FAR: i64 = 1_000_000;

/// Returns the greatest duration for which `does` holds, up to `epsilon`. `None` if it holds up to
/// `most`, or up to the longest duration examined. It must hold for `least`. With disjunctive
/// conditions there may be a gap; the search ends before the gap.
fn greatest(
    least: &Rational,
    most: Option<&Rational>,
    epsilon: &Rational,
    does: &mut dyn FnMut(&Rational) -> bool,
) -> Option<Rational> {
    let unit = least.clone().max(Rational::ONE);
    let far = least + &unit * Rational::from(FAR);
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
