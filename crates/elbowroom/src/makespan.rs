//! How long a plan takes.

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;
use elbowroom_plan::{Node, ParametrizedPlan, Valuation, network_node};
use elbowroom_stn::{ConsistentNetwork, Constraint, Network, NodeId};

/// The end time of the last action if everything starts as early as it can, the parameters have
/// these values, and actions take as long as they are told to; `None` if the plan has no schedule
/// then.
pub fn earliest_end(plan: &ParametrizedPlan, valuation: &Valuation) -> Option<Rational> {
    let network = as_told(plan, plan.plan.network(valuation))?;
    let schedule = network.earliest_schedule(NodeId(0));
    plan.plan
        .nodes()
        .filter(|(_, node)| !matches!(node, Node::Timed(_)))
        .map(|(id, _)| schedule.times()[id.index()].clone())
        .max()
}

/// The end time of the last action.
pub(crate) fn end(plan: &TimeTriggeredPlan) -> Rational {
    let ends = plan.steps.iter().map(|step| {
        let duration = step.duration.clone().unwrap_or_default();
        &step.start + &duration
    });
    ends.max().unwrap_or_default()
}

/// The schedules of a plan in which the durations that the executor chooses are as planned, as it
/// tells actions ([`ParametrizedPlan::told`]), or, if there is none, all; `None` if there is none
/// at all.
///
/// A plan that works for other durations only is guaranteed in the weak sense at most.
pub(crate) fn as_told(plan: &ParametrizedPlan, network: Network) -> Option<ConsistentNetwork> {
    let mut told = network.clone();
    for constraint in &plan.plan.constraints {
        if let Some(duration) = plan.told_by(constraint) {
            let (from, to) = (network_node(constraint.from), network_node(constraint.to));
            told.add(Constraint::at_least(from, to, duration.clone()));
            told.add(Constraint::at_most(from, to, duration.clone()));
        }
    }
    ConsistentNetwork::try_from(told)
        .or_else(|_| ConsistentNetwork::try_from(network))
        .ok()
}
