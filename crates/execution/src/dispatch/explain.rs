//! Explanations: the plan's constraints that cause a bound or a conflict.

use elbowroom_model::Task;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{InstanceId, NodeId, StnPlan, network_node};
use elbowroom_stn::WindowEnd;

use super::{Bounds, Dispatch};
use crate::horizon::NetworkLimit;
use crate::reason::{Behind, Changed};

/// Number of constraints of a long chain that are named.
const MOST_NAMED: usize = 4;

/// Describes a constraint of a plan; a timed initial without its time.
pub(super) fn named(task: &Task, plan: &StnPlan, index: usize) -> Behind {
    let constraint = &plan.constraints[index];
    if let elbowroom_plan::Reason::Timed(timed) = constraint.reason {
        return Behind::Timed {
            changes: Changed::all(task, &task.timed()[timed].changes),
            at: None,
        };
    }
    if let Some(id) = plan.duration_of(constraint) {
        return Behind::Duration(plan.instance(id).action.name.clone());
    }
    let node = |id: NodeId| plan.node_words(task, id);
    Behind::Order {
        first: node(constraint.from),
        second: node(constraint.to),
    }
}

impl Dispatch {
    /// Returns the plan's constraints that cause one end of a node's window. Of a long chain, only
    /// both ends are returned: the origin, for example a deadline, and the constraints next to the
    /// node.
    pub(super) fn behind(&self, node: NodeId, end: WindowEnd) -> Vec<Behind> {
        let limits = self.horizon.grounds(network_node(node), end);
        let named = |limit: &NetworkLimit| {
            let index = self.sources.of(*limit)?;
            let mut named = named(&self.task, &self.plan, index);
            if let (elbowroom_plan::Reason::Timed(timed), Behind::Timed { at, .. }) =
                (&self.plan.constraints[index].reason, &mut named)
            {
                *at = Some(self.world(&self.task.timed()[*timed].time));
            }
            Some(named)
        };
        let mut chain: Vec<Behind> = limits.iter().filter_map(named).collect();
        chain.dedup();
        if chain.len() > MOST_NAMED {
            let last = chain.split_off(chain.len() - MOST_NAMED / 2);
            chain.truncate(MOST_NAMED / 2);
            chain.push(Behind::Others);
            chain.extend(last);
        }
        chain
    }

    /// Returns `true` if this end of the window of an instance's end is limited by the instance's
    /// own duration.
    pub(super) fn is_limited_by_duration(&self, id: InstanceId, end: WindowEnd) -> bool {
        let node = network_node(self.ends[id.index()][1]);
        let behind = self.horizon.grounds(node, end);
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
