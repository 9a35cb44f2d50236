//! Explanations: the plan's constraints that cause a bound or a conflict.

use elbowroom_model::Task;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{InstanceId, NodeId, StnPlan, network_node};
use elbowroom_stn::WindowEnd;

use super::{Bounds, Dispatch};
use crate::reason::{Evidence, TimedChange};
use crate::window_propagation::NetworkLimit;

/// Number of constraints of a long chain that are named.
const MAX_NAMED_CONSTRAINTS: usize = 4;

/// Describes a constraint of a plan whose clock reads 0 at `origin` on the world's clock.
pub(super) fn describe_constraint(
    task: &Task,
    plan: &StnPlan,
    origin: &Rational,
    index: usize,
) -> Evidence {
    let constraint = &plan.constraints[index];
    if let elbowroom_plan::Reason::Timed(timed) = constraint.reason {
        let timed = &task.timed()[timed];
        return Evidence::Timed {
            changes: TimedChange::all(task, &timed.changes),
            at: Some(origin + &timed.time),
        };
    }
    if let Some(id) = plan.duration_of(constraint) {
        return Evidence::Duration(plan.instance(id).action.name.clone());
    }
    let node = |id: NodeId| plan.describe_node_from(task, id, origin);
    Evidence::Order {
        first: node(constraint.from),
        second: node(constraint.to),
    }
}

impl Dispatch {
    /// Describes a time point of the plan, with times on the world's clock.
    pub(super) fn describe_node(&self, node: NodeId) -> String {
        self.plan.describe_node_from(&self.task, node, &self.origin)
    }

    /// Describes a constraint of the plan, with times on the world's clock.
    pub(super) fn describe_constraint(&self, index: usize) -> Evidence {
        describe_constraint(&self.task, &self.plan, &self.origin, index)
    }

    /// Returns the plan's constraints that cause one end of a node's window. Of a long chain, only
    /// both ends are returned: the origin, for example a deadline, and the constraints next to the
    /// node.
    pub(super) fn window_evidence(&self, node: NodeId, end: WindowEnd) -> Vec<Evidence> {
        let limits = self.horizon.window_causes(network_node(node), end);
        let named = |limit: &NetworkLimit| {
            let index = self.sources.of(*limit)?;
            Some(self.describe_constraint(index))
        };
        let mut chain: Vec<Evidence> = limits.iter().filter_map(named).collect();
        chain.dedup();
        if chain.len() > MAX_NAMED_CONSTRAINTS {
            let last = chain.split_off(chain.len() - MAX_NAMED_CONSTRAINTS / 2);
            chain.truncate(MAX_NAMED_CONSTRAINTS / 2);
            chain.push(Evidence::Others);
            chain.extend(last);
        }
        chain
    }

    /// Returns `true` if this end of the window of an instance's end is limited by the instance's
    /// own duration.
    pub(super) fn is_limited_by_duration(&self, id: InstanceId, end: WindowEnd) -> bool {
        let node = network_node(self.ends[id.index()][1]);
        let behind = self.horizon.window_causes(node, end);
        let index = behind.last().and_then(|behind| self.sources.of(*behind));
        index.is_some_and(|index| self.plan.duration_of(&self.plan.constraints[index]) == Some(id))
    }
}

/// Converts bounds to an interval.
pub(super) fn interval(bounds: &Bounds) -> Interval {
    let end = |bound: &Option<Rational>| bound.clone().map_or(End::Infinite, End::Closed);
    Interval {
        lower: end(&bounds.0),
        upper: end(&bounds.1),
    }
}
