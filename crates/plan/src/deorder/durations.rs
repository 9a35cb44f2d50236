//! Durations that the domain allows, if they are the same in all schedules.
//!
//! Duration bounds may read fluents. Happenings that write such a fluent keep their order with the
//! happening that reads it. So its value is the same in all schedules unless it changed
//! continuously, or by an amount that itself depends on the schedule.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{
    Body, Change, ContinuousEffect, DurationConstraint, Effect, Expression, FluentId,
};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_model::{Footprint, State, Task};
use elbowroom_num::{End, Interval, Rational};

use super::over_all;
use crate::durations::allowed;
use crate::network::Schedule;
use crate::stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, Reason, StnPlan};

/// Returns a constraint for the duration of each durative instance: the domain's bounds, or the
/// original duration if these depend on the schedule.
pub(crate) fn constraints(task: &Task, plan: &StnPlan, times: &Schedule) -> Vec<Constraint> {
    let intervals = intervals(task, plan, times);
    let mut nodes = vec![(NodeId::ZERO, NodeId::ZERO); plan.instances.len()];
    for (node, what) in plan.nodes() {
        match what {
            Node::Start(id) => nodes[id.index()].0 = node,
            Node::End(id) => nodes[id.index()].1 = node,
            _ => {}
        }
    }
    let constraint = |(index, interval): (usize, Option<Interval>)| {
        let id = InstanceId::from(index);
        plan.instance(id).action.durative()?;
        let (from, to) = nodes[index];
        let original = &times[to] - &times[from];
        // In the original plan, the over-all condition was vacuous and has not been checked.
        let is_unchecked = original.is_zero() && over_all::has_over_all_condition(plan, id);
        let bounds = interval.filter(|_| !is_unchecked).and_then(bounds);
        let (lower, upper, reason) = match bounds {
            Some((lower, upper)) => (lower, upper, Reason::Duration(id)),
            None => (original.clone().into(), original.into(), Reason::Pinned),
        };
        Some(Constraint {
            from,
            to,
            lower,
            upper,
            reason,
        })
    };
    intervals
        .into_iter()
        .enumerate()
        .filter_map(constraint)
        .collect()
}

/// Returns a constraint for the duration of each durative instance: the domain's bounds if they
/// read no changing fluent, else only that it is not negative.
pub(crate) fn state_independent_bounds(
    task: &Task,
    plan: &StnPlan,
    footprints: &[Footprint],
) -> Vec<Constraint> {
    let mut changing: BTreeSet<FluentId> = BTreeSet::new();
    for footprint in footprints {
        changing.extend(footprint.shifts.iter().chain(&footprint.assigns));
    }
    let values = &task.initial().values;
    let mut value = |leaf: &Expression| match leaf {
        Expression::Fluent(fluent) if !changing.contains(fluent) => values.get(fluent).cloned(),
        _ => None,
    };
    let instances = plan.instances.iter().enumerate();
    let constraint = |(index, instance): (usize, &Instance)| {
        let body = instance.action.durative()?;
        let id = InstanceId::from(index);
        let (lower, upper) = allowed(&body.duration, &mut value)
            .and_then(bounds)
            .unwrap_or((Bound::Finite(Rational::ZERO), Bound::Infinite));
        Some(Constraint {
            from: plan.start(id),
            to: plan.end(id),
            lower,
            upper,
            reason: Reason::Duration(id),
        })
    };
    instances.filter_map(constraint).collect()
}

/// Returns the interval as bounds, unless an end is open.
fn bounds(interval: Interval) -> Option<(Bound, Bound)> {
    let bound = |end| match end {
        End::Closed(value) => Some(Bound::Finite(value)),
        End::Infinite => Some(Bound::Infinite),
        End::Open(_) => None,
    };
    Some((bound(interval.lower)?, bound(interval.upper)?))
}

/// Returns the possible durations of each instance; `None` if they depend on the schedule.
pub(super) fn intervals(task: &Task, plan: &StnPlan, times: &Schedule) -> Vec<Option<Interval>> {
    let mut nodes: Vec<(NodeId, Node)> = plan.nodes().collect();
    nodes.sort_by(|(a, _), (b, _)| times[*a].cmp(&times[*b]));
    let mut values = Values::new(task.initial());
    let mut intervals = vec![Some(Interval::at_least(Rational::ZERO)); plan.instances.len()];
    for group in nodes.chunk_by(|(a, _), (b, _)| times[*a] == times[*b]) {
        let arrival = values.clone();
        for &(_, what) in group {
            read_bounds(plan, what, &arrival, &mut intervals);
            write_effects(task, plan, what, &arrival, &intervals, &mut values);
        }
    }
    intervals
}

/// Intersects the instance's interval with the bounds that this happening reads.
fn read_bounds(plan: &StnPlan, what: Node, arrival: &Values, intervals: &mut [Option<Interval>]) {
    let (Node::Start(id) | Node::End(id)) = what else {
        return;
    };
    let Some(body) = plan.instance(id).action.durative() else {
        return;
    };
    let is_end = matches!(what, Node::End(_));
    let read_here = |constraint: &&DurationConstraint| constraint.at_end == is_end;
    let here = allowed(body.duration.iter().filter(read_here), &mut |leaf| {
        arrival.value(leaf, None)
    });
    let interval = &mut intervals[id.index()];
    *interval = match (interval.take(), here) {
        (Some(so_far), Some(here)) => Some(so_far.intersection(&here)),
        _ => None,
    };
}

fn write_effects(
    task: &Task,
    plan: &StnPlan,
    what: Node,
    arrival: &Values,
    intervals: &[Option<Interval>],
    values: &mut Values,
) {
    let (id, is_end) = match what {
        Node::Zero => return,
        Node::Timed(index) => {
            for change in &task.timed()[index].changes {
                values.change(change, true, arrival, None);
            }
            return;
        }
        Node::Start(id) | Node::Instant(id) => (id, false),
        Node::End(id) => (id, true),
    };
    let duration = fixed(intervals[id.index()].as_ref());
    let (effects, continuous): (&[Effect], &[ContinuousEffect]) =
        match &plan.instance(id).action.body {
            Body::Instantaneous(snap) => (&snap.effects, &[]),
            Body::Durative(body) if is_end => (&body.end.effects, &body.continuous),
            Body::Durative(body) => (&body.start.effects, &body.continuous),
        };
    for effect in continuous {
        values.set_running(effect.fluent, !is_end);
    }
    for effect in effects {
        values.change(&effect.change, effect.guard.is_trivial(), arrival, duration);
    }
}

/// Returns the duration, if the domain leaves no choice.
fn fixed(interval: Option<&Interval>) -> Option<&Rational> {
    match interval {
        Some(Interval {
            lower: End::Closed(lower),
            upper: End::Closed(upper),
        }) if lower == upper => Some(lower),
        _ => None,
    }
}

/// Values that are the same in all schedules.
#[derive(Clone)]
struct Values {
    known: BTreeMap<FluentId, Rational>,
    /// Number of running continuous effects on each fluent.
    running: BTreeMap<FluentId, usize>,
}

impl Values {
    fn new(initial: &State) -> Self {
        Self {
            known: initial.values.clone(),
            running: BTreeMap::new(),
        }
    }

    fn value(&self, leaf: &Expression, duration: Option<&Rational>) -> Option<Rational> {
        match leaf {
            Expression::Fluent(fluent) => self.known.get(fluent).cloned(),
            Expression::Duration => duration.cloned(),
            _ => None,
        }
    }

    /// Starts or stops a continuous effect. The value of the fluent becomes unknown.
    fn set_running(&mut self, fluent: FluentId, begins: bool) {
        self.known.remove(&fluent);
        let count = self.running.entry(fluent).or_default();
        *count = if begins {
            *count + 1
        } else {
            count.saturating_sub(1)
        };
    }

    /// Applies an effect. Without `is_certain`, it may also not happen.
    fn change(
        &mut self,
        change: &Change,
        is_certain: bool,
        arrival: &Self,
        duration: Option<&Rational>,
    ) {
        let Change::Update {
            operator,
            fluent,
            value,
        } = change
        else {
            return;
        };
        let amount = value.evaluate(&mut |leaf| arrival.value(leaf, duration));
        // Simultaneous increases of one fluent add up, so the present value counts.
        let present = self.known.remove(fluent);
        if !is_certain || self.running.get(fluent).is_some_and(|&count| count > 0) {
            return;
        }
        let updated = match (operator, present, amount) {
            (UpdateOperator::Assign, _, amount) => amount,
            (UpdateOperator::Increase, Some(present), Some(amount)) => Some(present + amount),
            (UpdateOperator::Decrease, Some(present), Some(amount)) => Some(present - amount),
            (UpdateOperator::ScaleUp, Some(present), Some(amount)) => Some(present * amount),
            (UpdateOperator::ScaleDown, Some(present), Some(amount)) => {
                present.checked_div(&amount)
            }
            _ => None,
        };
        if let Some(updated) = updated {
            self.known.insert(*fluent, updated);
        }
    }
}
