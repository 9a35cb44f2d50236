//! Timed initials that change what the goal reads stay on their side of the plan's end, unless all
//! they do to it is to make facts as the goal needs them, and they need not be waited for.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Change, Condition, FactId};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use super::order::Order;
use crate::network::Schedule;
use crate::stn_plan::{Node, NodeId, Reason, StnPlan};

/// The goal is read after the last happening of the plan's actions, whichever that is.
pub(super) fn order(task: &Task, plan: &StnPlan, times: &Schedule, order: &mut Order) {
    let goal = Footprint::of_condition(task, task.goal());
    let finals: Vec<NodeId> = plan
        .nodes()
        .filter(|(_, what)| matches!(what, Node::End(_) | Node::Instant(_)))
        .map(|(node, _)| node)
        .collect();
    let time = |node: NodeId| &times[node];
    let Some(&last) = finals.iter().max_by_key(|&&node| time(node)) else {
        return;
    };
    let wanted = wanted(task);
    for (node, what) in plan.nodes() {
        let Node::Timed(index) = what else {
            continue;
        };
        if time(node) > time(last) && serves(&wanted, &task.timed()[index].changes) {
            continue;
        }
        if !Footprint::of_timed(&task.timed()[index]).writes_what_is_read_by(&goal) {
            continue;
        }
        if time(node) > time(last) {
            // Strictly later is enough; the original may be closer than ε.
            let gap = (time(node) - time(last)).min(task.epsilon().clone());
            for &last in &finals {
                order.demand(last, node, gap.clone(), Reason::Interference);
            }
        } else if !order.has_successor(node) {
            order.demand(node, last, Rational::ZERO, Reason::Interference);
        }
    }
}

/// The facts that the goal reads in no other way than to need them true, or false.
fn wanted(task: &Task) -> BTreeMap<FactId, Option<bool>> {
    let mut wanted: BTreeMap<FactId, Option<bool>> = BTreeMap::new();
    let mut note = |fact: FactId, truth: Option<bool>| {
        let known = wanted.entry(fact).or_insert(truth);
        if *known != truth {
            *known = None;
        }
    };
    for conjunct in task.goal().conjuncts() {
        let literal = match conjunct {
            Condition::Fact(fact) => Some((*fact, true)),
            Condition::Not(part) => match **part {
                Condition::Fact(fact) => Some((fact, false)),
                _ => None,
            },
            _ => None,
        };
        match literal.filter(|(fact, _)| !task.is_derived(*fact)) {
            Some((fact, truth)) => note(fact, Some(truth)),
            None => task.visit_facts_of(conjunct, &mut |fact| note(fact, None)),
        }
    }
    wanted
}

/// Whether the changes do nothing to the facts of the goal but what it wants, and nothing to
/// numbers. As the goal holds before them, it holds after them.
fn serves(wanted: &BTreeMap<FactId, Option<bool>>, changes: &[Change]) -> bool {
    changes.iter().all(|change| {
        let (fact, truth) = match change {
            Change::Add(fact) => (fact, true),
            Change::Delete(fact) => (fact, false),
            Change::Update { .. } => return false,
        };
        wanted.get(fact).is_none_or(|wanted| *wanted == Some(truth))
    })
}
