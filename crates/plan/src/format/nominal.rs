//! Nominal values that an STN plan file does not give.

use elbowroom_model::Task;
use elbowroom_model::ground::Expression;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_stn::{ConsistentNetwork, Network};

use crate::durations;
use crate::network::{Schedule, network_node};
use crate::parameter::ParameterKind;
use crate::stn_plan::{Bound, InstanceId, NodeId, StnPlan};
use crate::valuation::ParameterId;

/// A parameter whose nominal value may still be missing.
#[derive(Debug)]
pub(super) struct Draft {
    pub(super) kind: ParameterKind,
    pub(super) nominal: Option<Rational>,
    pub(super) range: Interval,
}

/// Returns a nominal value for each parameter, `None` if none can be found.
///
/// Values that the domain fixes come first. The others are taken from the earliest schedule of the
/// network, where bounds without a value are limited only by the parameters' ranges.
pub(super) fn find(task: &Task, plan: &StnPlan, drafts: &[Draft]) -> Vec<Option<Rational>> {
    let mut ranges: Vec<Interval> = drafts
        .iter()
        .map(|draft| match &draft.nominal {
            Some(nominal) => Interval::point(nominal.clone()),
            None => draft.range.clone(),
        })
        .collect();
    for (draft, range) in drafts.iter().zip(&mut ranges) {
        if let (ParameterKind::Duration(id), None) = (draft.kind, &draft.nominal)
            && let Some(allowed) = domain_durations(task, plan, id)
        {
            let both = range.intersection(&allowed);
            if !both.is_empty() {
                *range = both;
            }
        }
    }
    let schedule = earliest(plan, &ranges);
    let find = |(index, range): (usize, &Interval)| {
        if let (End::Closed(lower), End::Closed(upper)) = (&range.lower, &range.upper)
            && lower == upper
        {
            return Some(lower.clone());
        }
        let value = value_in(plan, ParameterId::from(index), schedule.as_ref()?)?;
        Some(value).filter(|value| range.contains(value))
    };
    ranges.iter().enumerate().map(find).collect()
}

/// Returns the durations that the domain allows for the instance, as far as the initial state
/// determines them.
fn domain_durations(task: &Task, plan: &StnPlan, id: InstanceId) -> Option<Interval> {
    // The plan's own action no longer contains its duration constraints.
    let action = &plan.instance(id).action;
    let original = task.instantiate(action.schema, &action.arguments).ok()?;
    let constraints = &original.durative()?.duration;
    durations::allowed(constraints, &mut |leaf| match leaf {
        Expression::Fluent(fluent) => task.initial().values.get(fluent).cloned(),
        _ => None,
    })
}

/// Returns the earliest schedule if each occurrence of a parameter may have any value of its range.
fn earliest(plan: &StnPlan, ranges: &[Interval]) -> Option<Schedule> {
    let mut network = Network::with_nodes(plan.nodes.len());
    let zero = network_node(NodeId::ZERO);
    for (node, _) in plan.nodes().skip(1) {
        let node = network_node(node);
        network.add(elbowroom_stn::Constraint::at_least(
            zero,
            node,
            Rational::ZERO,
        ));
    }
    let limit = |bound: &Bound, end: fn(&Interval) -> &End| match bound {
        Bound::Infinite => None,
        Bound::Finite(value) => Some(value.clone()),
        Bound::Parameter(id) => end(&ranges[id.index()]).value().cloned(),
    };
    for constraint in &plan.constraints {
        let (from, to) = (network_node(constraint.from), network_node(constraint.to));
        if let Some(lower) = limit(&constraint.lower, |range| &range.lower) {
            network.add(elbowroom_stn::Constraint::at_least(from, to, lower));
        }
        if let Some(upper) = limit(&constraint.upper, |range| &range.upper) {
            network.add(elbowroom_stn::Constraint::at_most(from, to, upper));
        }
    }
    let network = ConsistentNetwork::try_from(network).ok()?;
    Some(network.earliest_schedule(zero).into())
}

/// Returns a value for which all constraints with the parameter hold in the schedule.
fn value_in(plan: &StnPlan, id: ParameterId, schedule: &Schedule) -> Option<Rational> {
    let mut least = None;
    let mut greatest = None;
    for constraint in &plan.constraints {
        let difference = &schedule[constraint.to] - &schedule[constraint.from];
        // A lower bound must not be greater than the difference, an upper one not less.
        if constraint.lower == Bound::Parameter(id) {
            greatest = Some(match greatest {
                Some(so_far) if so_far < difference => so_far,
                _ => difference.clone(),
            });
        }
        if constraint.upper == Bound::Parameter(id) {
            least = Some(match least {
                Some(so_far) if so_far > difference => so_far,
                _ => difference,
            });
        }
    }
    match (least, greatest) {
        (Some(least), Some(greatest)) if least > greatest => None,
        (Some(value), _) | (None, Some(value)) => Some(value),
        (None, None) => None,
    }
}
