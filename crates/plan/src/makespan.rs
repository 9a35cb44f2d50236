//! Makespan of plans.

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;
use elbowroom_stn::{ConsistentNetwork, Constraint, Network, NodeId};

use crate::{Node, ParametrizedPlan, Valuation, network_node};

/// Returns the end time of the last action in the earliest schedule with these values of the
/// parameters; `None` if the plan has no schedule. Durations that the executor chooses are as
/// planned, if possible.
pub fn earliest_end(plan: &ParametrizedPlan, valuation: &Valuation) -> Option<Rational> {
    let network = with_fixed_choices(plan, plan.plan.network(valuation))?;
    let schedule = network.earliest_schedule(NodeId(0));
    plan.plan
        .nodes()
        .filter(|(_, node)| !matches!(node, Node::Timed(_)))
        .map(|(id, _)| schedule.times()[id.index()].clone())
        .max()
}

/// Returns the end time of the last action.
pub fn last_end(plan: &TimeTriggeredPlan) -> Rational {
    let ends = plan.steps.iter().map(|step| {
        let duration = step.duration.clone().unwrap_or_default();
        &step.start + &duration
    });
    ends.max().unwrap_or_default()
}

/// Returns the network of the schedules where the durations that the executor chooses are as
/// planned. If there is no such schedule, it is the
/// network of all schedules; `None` if there are none at all.
///
/// A plan that works only for other durations has at most the weak guarantee.
pub fn with_fixed_choices(plan: &ParametrizedPlan, network: Network) -> Option<ConsistentNetwork> {
    let mut told = network.clone();
    for constraint in &plan.plan.constraints {
        if let Some(duration) = plan.commanded_duration(constraint) {
            let (from, to) = (network_node(constraint.from), network_node(constraint.to));
            told.add(Constraint::at_least(from, to, duration.clone()));
            told.add(Constraint::at_most(from, to, duration.clone()));
        }
    }
    ConsistentNetwork::try_from(told)
        .or_else(|_| ConsistentNetwork::try_from(network))
        .ok()
}
