//! All orders, one after the other.

use elbowroom_model::Footprint;
use elbowroom_plan::{Node, NodeId};
use elbowroom_probability::{Candidates, Likelihoods, OrderSearch, Semantics};

use super::Worlds;
use super::random::Case;

/// All orders, with their P(A ∩ G), as [`best`] counts them.
pub(crate) fn all(
    case: &Case,
    semantics: Semantics,
    search: &OrderSearch,
) -> Vec<(Vec<NodeId>, f64)> {
    let certain = Likelihoods::certain();
    let worlds = |likelihoods, semantics| {
        let (task, plan) = (&case.task, &case.plan);
        Worlds::new(task, plan, likelihoods, semantics, &case.circumstances)
    };
    let both = (
        worlds(&case.likelihoods, semantics),
        worlds(&certain, Semantics::Paper),
    );
    let mut orders = Vec::new();
    extend(case, search, both, &mut Vec::new(), &mut orders);
    orders
}

/// The best P(A ∩ G) of all orders, and how many happenings the shortest of those that are as
/// likely has. Only those count for which there is time, which is asked of the network as a whole,
/// and those that work nominally if the settings ask for it.
pub(crate) fn best(
    case: &Case,
    semantics: Semantics,
    search: &OrderSearch,
) -> Option<(f64, usize)> {
    let orders = all(case, semantics, search);
    let best = orders.iter().map(|(_, p)| *p).reduce(f64::max)?;
    let likeliest = orders.iter().filter(|(_, p)| *p >= best * (1.0 - 1e-10));
    Some((best, likeliest.map(|(order, _)| order.len()).min()?))
}

fn extend(
    case: &Case,
    search: &OrderSearch,
    (worlds, nominal): (Worlds<'_>, Worlds<'_>),
    sequence: &mut Vec<NodeId>,
    orders: &mut Vec<(Vec<NodeId>, f64)>,
) {
    if search.windows(&case.circumstances, sequence).is_none() {
        return;
    }
    let must_work = search.settings().candidates == Candidates::Working;
    let is_timed = |node: &NodeId| matches!(case.plan.nodes[node.index()], Node::Timed(_));
    if worlds.running().is_empty() && may_be_over(case, sequence) {
        let p = worlds.success_probability();
        let counts = !must_work || nominal.success_probability() > 0.0;
        if counts && p > 0.0 {
            orders.push((sequence.clone(), p));
        }
    }
    let is_dead = must_work && nominal.actions_probability() == 0.0;
    if is_dead || worlds.actions_probability() == 0.0 {
        return;
    }
    let next_timed = sequence.iter().filter(|node| is_timed(node)).count();
    for (at, what) in case.plan.nodes.iter().enumerate() {
        let node = NodeId::from(at);
        let is_new = !sequence.contains(&node);
        let is_next = match what {
            Node::Zero => false,
            Node::Start(id) | Node::Instant(id) => is_new && !case.circumstances.is_running(*id),
            Node::End(id) => worlds.running().contains(id),
            Node::Timed(index) => is_new && *index == next_timed,
        };
        let is_allowed = !search.settings().keeps_interference
            || !case
                .plan
                .interference()
                .any(|link| link.from == node && sequence.contains(&link.to));
        if is_next && is_allowed {
            let (mut worlds, mut nominal) = (worlds.clone(), nominal.clone());
            worlds.push(node);
            nominal.push(node);
            sequence.push(node);
            extend(case, search, (worlds, nominal), sequence, orders);
            sequence.pop();
        }
    }
}

/// The goal counts after all timed initials: those to come that change what it reads belong to an
/// order, and an order ends with no other ones.
fn may_be_over(case: &Case, sequence: &[NodeId]) -> bool {
    let goal = Footprint::of_condition(&case.task, case.task.goal());
    let concerns_goal =
        |index: usize| Footprint::of_timed(&case.task.timed()[index]).writes_what_is_read_by(&goal);
    let is_to_come = |index: usize| case.task.timed()[index].time > case.circumstances.now;
    let mut nodes = (0..).map(NodeId::from).zip(&case.plan.nodes);
    let is_complete = nodes.all(|(node, what)| match what {
        Node::Timed(index) if is_to_come(*index) && concerns_goal(*index) => {
            sequence.contains(&node)
        }
        _ => true,
    });
    let ends_well = sequence
        .last()
        .is_none_or(|last| match case.plan.nodes[last.index()] {
            Node::Timed(index) => concerns_goal(index),
            _ => true,
        });
    is_complete && ends_well
}
