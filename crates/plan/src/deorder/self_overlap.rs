//! Separation of instances of one ground action that do not overlap in the plan.

use std::collections::BTreeMap;

use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_num::Rational;

use super::order::Order;
use crate::network::Schedule;
use crate::stn_plan::{Node, NodeId, Reason, StnPlan};

/// Adds the constraints that an instance starts no earlier than the ends of those instances of its
/// action that have ended by its start in the plan. Instances that overlap in the plan may overlap
/// in each schedule.
pub(super) fn order(plan: &StnPlan, times: &Schedule, order: &mut Order) {
    let mut nodes: Vec<[Option<NodeId>; 2]> = vec![[None; 2]; plan.instances.len()];
    for (node, what) in plan.nodes() {
        match what {
            Node::Start(id) => nodes[id.index()][0] = Some(node),
            Node::End(id) => nodes[id.index()][1] = Some(node),
            _ => {}
        }
    }
    let mut instances: BTreeMap<(SchemaId, &[ObjectId]), Vec<Instance>> = BTreeMap::new();
    for (own, ends) in plan.instances.iter().zip(nodes) {
        let [Some(start), Some(end)] = ends else {
            continue;
        };
        let action = &own.action;
        let earlier = instances
            .entry((action.schema, &action.arguments))
            .or_default();
        let has_ended = |other: &Instance| times[other.end] <= times[start];
        for other in earlier.iter().rev().filter(|other| has_ended(other)) {
            order.require_distance(other.end, start, Rational::ZERO, Reason::SelfOverlap);
            if other.is_alone {
                break;
            }
        }
        let is_alone = earlier.iter().all(has_ended);
        earlier.push(Instance { end, is_alone });
    }
}

/// An instance that has been processed.
struct Instance {
    end: NodeId,
    /// `true` if all earlier instances of the action end before it starts.
    is_alone: bool,
}
