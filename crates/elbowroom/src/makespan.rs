//! How long a plan takes.

use elbowroom_num::Rational;
use elbowroom_plan::{Node, ParametrizedPlan, Valuation};
use elbowroom_stn::{ConsistentNetwork, NodeId};

/// The end time of the last action if everything starts as early as it can and the parameters have
/// these values; `None` if the plan has no schedule then.
pub fn earliest_end(plan: &ParametrizedPlan, valuation: &Valuation) -> Option<Rational> {
    let network = ConsistentNetwork::try_from(plan.plan.network(valuation)).ok()?;
    let schedule = network.earliest_schedule(NodeId(0));
    plan.plan
        .nodes()
        .filter(|(_, node)| !matches!(node, Node::Timed(_)))
        .map(|(id, _)| schedule.times()[id.index()].clone())
        .max()
}
