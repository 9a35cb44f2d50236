//! Enumeration of all orders.

use elbowroom_model::Footprint;
use elbowroom_plan::{Node, NodeId};
use elbowroom_probability::{Candidates, Happenings, Likelihoods, OrderSearch, Semantics};

use super::Worlds;
use super::random::Case;

/// An order.
pub(crate) struct Order {
    pub(crate) sequence: Vec<NodeId>,
    /// `true` if it has happenings at one moment.
    pub(crate) has_joined: bool,
    /// P(A ∩ G).
    pub(crate) probability: f64,
}

/// Returns all orders, as [`best`] counts them.
pub(crate) fn all(case: &Case, semantics: Semantics, search: &OrderSearch) -> Vec<Order> {
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
    let mut sequence = (Vec::new(), Vec::new());
    extend(case, search, both, (&mut sequence, false), &mut orders);
    orders
}

/// Returns the best P(A ∩ G) of all orders, and the length of the shortest one with this
/// probability. An order counts if the whole network has a schedule, and, if the settings require
/// it, if it works nominally. Happenings may come at one moment if over-all conditions may not hold
/// in between.
///
/// Without `may_join`, only orders without joined happenings count.
pub(crate) fn best(orders: &[Order], may_join: bool) -> Option<(f64, usize)> {
    let orders = orders.iter().filter(|order| may_join || !order.has_joined);
    let probabilities = orders.clone().map(|order| order.probability);
    let best = probabilities.reduce(f64::max)?;
    let likeliest = orders.filter(|order| order.probability >= best * (1.0 - 1e-10));
    Some((best, likeliest.map(|order| order.sequence.len()).min()?))
}

fn extend(
    case: &Case,
    search: &OrderSearch,
    (worlds, nominal): (Worlds<'_>, Worlds<'_>),
    (happenings, is_joined): (&mut (Vec<NodeId>, Vec<bool>), bool),
    orders: &mut Vec<Order>,
) {
    let sequence = &happenings.0;
    let so_far = Happenings {
        sequence,
        joined: &happenings.1,
    };
    if search.windows_of(&case.circumstances, so_far).is_none() {
        return;
    }
    let must_work = search.settings().candidates == Candidates::Working;
    let is_timed = |node: &NodeId| matches!(case.plan.nodes[node.index()], Node::Timed(_));
    if !is_joined && worlds.running().is_empty() && may_be_over(case, sequence) {
        let p = worlds.success_probability();
        let counts = !must_work || nominal.success_probability() > 0.0;
        if counts && p > 0.0 {
            orders.push(Order {
                sequence: sequence.clone(),
                has_joined: happenings.1.contains(&true),
                probability: p,
            });
        }
    }
    let is_dead = must_work && nominal.actions_probability() == 0.0;
    if is_dead || worlds.actions_probability() == 0.0 {
        return;
    }
    let sequence = sequence.clone();
    // At one moment ends come first, then timed initials, starts, and ends of actions that begin then.
    let moment = happenings.1.iter().rposition(|is_joined| !is_joined);
    let moment = sequence[moment.unwrap_or(0)..].to_vec();
    let rank = |node: NodeId| match case.plan.nodes[node.index()] {
        Node::End(id) => {
            let start = case.plan.nodes.iter().position(|it| *it == Node::Start(id));
            let begins = start.is_some_and(|start| moment.contains(&NodeId::from(start)));
            if begins { 3 } else { 0 }
        }
        Node::Timed(_) => 1,
        _ => 2,
    };
    let least = moment
        .last()
        .filter(|_| is_joined)
        .map_or(0, |last| rank(*last));
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
        if !is_next || !is_allowed || is_joined && rank(node) < least {
            continue;
        }
        for is_open in [false, true] {
            let (mut worlds, mut nominal) = (worlds.clone(), nominal.clone());
            worlds.push_as(node, (is_joined, is_open));
            nominal.push_as(node, (is_joined, is_open));
            let is_needed = must_work && (worlds.is_broken() || !nominal.is_settled());
            if is_open && !is_needed {
                continue;
            }
            happenings.0.push(node);
            happenings.1.push(is_joined);
            let next = (&mut *happenings, is_open);
            extend(case, search, (worlds, nominal), next, orders);
            happenings.0.pop();
            happenings.1.pop();
        }
    }
}

/// Returns `true` if timed initials allow an order to end here. The goal counts after all timed
/// initials. Pending ones that change a fact or number of the goal belong to an order, and an order
/// does not end with other ones.
fn may_be_over(case: &Case, sequence: &[NodeId]) -> bool {
    let goal = Footprint::of_condition(&case.task, case.task.goal());
    let concerns_goal =
        |index: usize| Footprint::of_timed(&case.task.timed()[index]).writes_reads_of(&goal);
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
