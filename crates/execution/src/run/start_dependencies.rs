//! Predecessors that the starts of a plan wait for.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Node, NodeId};

use crate::executor::{PreparedPlan, StepId};

/// A step, and `false` for its start or `true` for its end.
pub(super) type StepEvent = (StepId, bool);

/// A predecessor that a start of the present plan waits for.
#[derive(Clone, Debug)]
pub(super) struct StartDependency {
    pub(super) event: StepEvent,
    /// Minimum distance of the start after it.
    pub(super) min_delay: Rational,
}

/// Returns the predecessors that each start of a plan waits for, by the plan's network: starts and
/// ends, without fixed times.
pub(super) fn start_dependencies(mission: &PreparedPlan) -> BTreeMap<StepId, Vec<StartDependency>> {
    let plan = &mission.plan.plan;
    let moment = |node: NodeId| match plan.nodes[node.index()] {
        Node::Start(id) | Node::Instant(id) => Some((StepId::from(id), false)),
        Node::End(id) => Some((StepId::from(id), true)),
        Node::Zero | Node::Timed(_) => None,
    };
    let mut waits: BTreeMap<StepId, Vec<StartDependency>> = BTreeMap::new();
    let mut order = |earlier: NodeId, later: NodeId, least: Rational| {
        let (Some(moment), Some((step, false))) = (moment(earlier), moment(later)) else {
            return;
        };
        // Simultaneous starts do not wait for each other.
        let follows = moment.1 || mission.nominal[earlier] < mission.nominal[later];
        if moment.0 != step && (least.is_positive() || (least.is_zero() && follows)) {
            waits.entry(step).or_default().push(StartDependency {
                event: moment,
                min_delay: least,
            });
        }
    };
    for constraint in plan.constraints_at(&mission.plan.nominal()) {
        if let Bound::Finite(lower) = constraint.lower {
            order(constraint.from, constraint.to, lower);
        }
        if let Bound::Finite(upper) = constraint.upper {
            order(constraint.to, constraint.from, -upper);
        }
    }
    waits
}
