//! Timed initials that change what the goal reads stay on their side of the plan's end.

use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use super::order::Order;
use crate::stn_plan::{Node, NodeId, Reason, StnPlan};

/// The goal is read after the last happening of the plan's actions, whichever that is.
pub(super) fn order(
    task: &Task,
    plan: &StnPlan,
    times: &[Rational],
    epsilon: &Rational,
    order: &mut Order,
) {
    let goal = Footprint::of_condition(task, task.goal());
    let finals: Vec<NodeId> = plan
        .nodes()
        .filter(|(_, what)| matches!(what, Node::End(_) | Node::Instant(_)))
        .map(|(node, _)| node)
        .collect();
    let time = |node: NodeId| &times[node.index()];
    let Some(&last) = finals.iter().max_by_key(|&&node| time(node)) else {
        return;
    };
    for (node, what) in plan.nodes() {
        let Node::Timed(index) = what else {
            continue;
        };
        if !Footprint::of_timed(&task.timed()[index]).writes_what_is_read_by(&goal) {
            continue;
        }
        if time(node) > time(last) {
            // Strictly later is enough; the original may be closer than ε.
            let gap = (time(node) - time(last)).min(epsilon.clone());
            for &last in &finals {
                order.demand(last, node, gap.clone(), Reason::Interference);
            }
        } else if !order.has_successor(node) {
            order.demand(node, last, Rational::ZERO, Reason::Interference);
        }
    }
}
