//! Choice of durations that the domain leaves open.

use std::collections::BTreeSet;

use elbowroom_envelope::pipeline;
use elbowroom_execution::PreparationResult;
use elbowroom_model::Task;
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    InstanceId, NodeId, ParameterId, ParameterKind, ParametrizedPlan, Reason, Schedule, Side,
    StnPlan, Valuation, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint, Network};

/// Returns the actions to be started whose durations the domain leaves open. The executor chooses their durations.
fn open_durations(plan: &StnPlan) -> BTreeSet<InstanceId> {
    let open = plan.constraints.iter().filter_map(|constraint| {
        let Reason::Duration(id) = constraint.reason else {
            return None;
        };
        let action = &plan.instance(id).action;
        let body = action.durative()?;
        // The conditions and effects hold for the planned duration only.
        let reads_planned = action.with_planned_duration(&Rational::ONE).is_some();
        let is_open = constraint.lower != constraint.upper && !body.is_running && !reads_planned;
        is_open.then_some(id)
    });
    open.collect()
}

/// Moves open durations away from the ends of their intervals in the envelope. Returns `false` if
/// none is moved.
///
/// Planners choose them as short or as long as the domain and the goal permit, so that the smallest
/// deviation breaks the plan. Every value in the envelope has the same guarantee as the planned
/// one. However, the envelope may permit durations outside the domain's bounds, which may depend on
/// values that another duration changes. So no duration is changed unless the plan `given`, which
/// includes these bounds, is valid with all new values.
pub(super) fn choose(task: &Task, given: &StnPlan, prepared: &mut PreparationResult) -> bool {
    let Some(envelope) = &prepared.envelope else {
        return false;
    };
    let (plan, nominal) = (&mut prepared.plan, &mut prepared.nominal);
    let open = open_durations(given);
    let before = plan.nominal();
    let mut chosen = before.clone();
    for (index, parameter) in plan.parameters.iter().enumerate() {
        let ParameterKind::Duration(instance) = parameter.kind else {
            continue;
        };
        if open.contains(&instance) {
            let id = ParameterId::from(index);
            chosen[id] = away_from_ends(&parameter.nominal, envelope.interval(id));
        }
    }
    if chosen == before {
        return false;
    }
    let Some(schedule) = schedule_at(plan, nominal, &chosen) else {
        return false;
    };
    if !pipeline::validate_plan(task, &given.scheduled(&schedule)).is_valid() {
        return false;
    }
    for (parameter, value) in plan.parameters.iter_mut().zip(&chosen) {
        parameter.nominal.clone_from(value);
    }
    *nominal = schedule;
    true
}

/// Returns a value near this one with slack in the interval: 1/8 of the value at both ends and, if
/// enough slack remains below, 3/10 at the upper end. An action that is too short can be repeated;
/// one that is too long may violate a condition, and fail. No value becomes shorter than the middle
/// of the interval.
fn away_from_ends(value: &Rational, interval: &Interval) -> Rational {
    let [least, most] = Side::BOTH.map(|side| side.of(interval).value());
    let least = least.cloned().unwrap_or_default();
    let below = &least * Rational::new(8, 7);
    let Some(most) = most else {
        return below.max(value.clone());
    };
    let above = most * Rational::new(8, 9);
    let far_above = most * Rational::new(10, 13);
    let longer = below.clone().min(far_above.clone()).max(value.clone());
    let middle = (least + most) / Rational::from(2);
    longer.min(below.min(above).max(far_above).max(middle))
}

/// Returns the earliest schedule with these durations; if possible, each event happens no earlier
/// than planned. Durations without a parameter stay as planned.
fn schedule_at(
    plan: &ParametrizedPlan,
    nominal: &Schedule,
    values: &Valuation,
) -> Option<Schedule> {
    let origin = network_node(NodeId::ZERO);
    let mut network = plan.plan.network(values);
    for (&id, planned) in &plan.commanded_durations {
        let [start, end] = [plan.plan.start(id), plan.plan.end(id)].map(network_node);
        network.add(Constraint::at_least(start, end, planned.clone()));
        network.add(Constraint::at_most(start, end, planned.clone()));
    }
    let mut as_planned = network.clone();
    for (node, _) in plan.plan.nodes().skip(1) {
        let time = nominal[node].clone();
        as_planned.add(Constraint::at_least(origin, network_node(node), time));
    }
    let earliest = |network: Network| {
        let network = ConsistentNetwork::try_from(network).ok()?;
        Some(Schedule::from(network.earliest_schedule(origin)))
    };
    earliest(as_planned).or_else(|| earliest(network))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(value: (i64, i64), least: (i64, i64), most: Option<(i64, i64)>) -> Rational {
        let number = |(numerator, denominator): (i64, i64)| Rational::new(numerator, denominator);
        let interval = match most {
            Some(most) => Interval::closed(number(least), number(most)),
            None => Interval::at_least(number(least)),
        };
        away_from_ends(&number(value), &interval)
    }

    #[test]
    fn chosen_duration_has_slack_on_both_sides() {
        // Enough slack on both sides.
        assert_eq!(chosen((10, 1), (7, 1), Some((13, 1))), Rational::from(10));
        assert_eq!(chosen((10, 1), (2, 1), None), Rational::from(10));
        // At the lower end: an eighth more than the least duration, unless that comes too near to the upper end.
        assert_eq!(chosen((7, 1), (7, 1), None), Rational::from(8));
        assert_eq!(chosen((7, 1), (7, 1), Some((26, 1))), Rational::from(8));
        assert_eq!(
            chosen((35, 2), (35, 2), Some((20, 1))),
            Rational::new(35, 2)
        );
        // At the upper end: 3/10 less, but not below the middle.
        assert_eq!(chosen((13, 1), (1, 1), Some((13, 1))), Rational::from(10));
        assert_eq!(
            chosen((10, 1), (15, 2), Some((10, 1))),
            Rational::new(35, 4)
        );
        assert_eq!(chosen((9, 1), (17, 2), Some((9, 1))), Rational::new(35, 4));
        assert_eq!(chosen((5, 1), (5, 1), Some((5, 1))), Rational::from(5));
    }
}
