//! Interfering happenings must be ε apart.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::{Footprint, Task};

use super::{BadCase, Difference, Obligation, Requirement};
use elbowroom_plan::{Bound, Node, NodeId, StnPlan};

/// The separation of every two interfering happenings, less those implied by others.
///
/// `order` lists all nodes in nominal order. If `a` is ε before `b` and `b` is ε before `c`, then
/// `a` is before `c`: only pairs without such a detour are obligations of their own. Nor are pairs
/// of timed initials at fixed times: the plan is not to blame for when they happen.
pub(super) fn separations(task: &Task, plan: &StnPlan, order: &[NodeId]) -> Vec<Obligation> {
    interfering_in_order(task, plan, order)
        .into_iter()
        .filter(|&(first, second)| !is_fixed(plan, first) || !is_fixed(plan, second))
        .map(|(first, second)| Obligation {
            requirement: Requirement::Separation { first, second },
            bad_cases: vec![BadCase {
                differences: vec![Difference {
                    from: first,
                    to: second,
                    bound: task.epsilon().clone(),
                    is_strict: true,
                }],
                inequalities: Vec::new(),
            }],
        })
        .collect()
}

/// Whether the node is a group of timed initials at a time that depends on no parameter.
pub(super) fn is_fixed(plan: &StnPlan, node: NodeId) -> bool {
    matches!(plan.nodes[node.index()], Node::Timed(_))
        && plan.constraints.iter().any(|constraint| {
            constraint.from == NodeId::ZERO
                && constraint.to == node
                && constraint.lower == constraint.upper
                && matches!(constraint.lower, Bound::Finite(_))
        })
}

/// The interfering pairs, earlier node first, less those connected through a third node.
pub(crate) fn interfering_in_order(
    task: &Task,
    plan: &StnPlan,
    order: &[NodeId],
) -> Vec<(NodeId, NodeId)> {
    let footprints: Vec<Footprint> = order
        .iter()
        .map(|&node| plan.footprint(task, node))
        .collect();
    let mut earlier: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); order.len()];
    for (a, b) in candidates(&footprints) {
        earlier[a.max(b)].insert(a.min(b));
    }
    let words = order.len().div_ceil(64);
    let mut ancestors: Vec<Vec<u64>> = Vec::with_capacity(order.len());
    let mut pairs = Vec::new();
    for (later, candidates) in earlier.iter().enumerate() {
        let mut reached = vec![0_u64; words];
        // Latest first, so that a detour is seen before the direct pair.
        for &candidate in candidates.iter().rev() {
            if reached[candidate / 64] >> (candidate % 64) & 1 == 0 {
                pairs.push((order[candidate], order[later]));
                for (word, more) in reached.iter_mut().zip(&ancestors[candidate]) {
                    *word |= more;
                }
                reached[candidate / 64] |= 1 << (candidate % 64);
            }
        }
        ancestors.push(reached);
    }
    pairs
}

/// All interfering pairs of positions, found through an index of who touches what.
fn candidates(footprints: &[Footprint]) -> BTreeSet<(usize, usize)> {
    #[derive(Default)]
    struct Users {
        readers: Vec<usize>,
        adders: Vec<usize>,
        deleters: Vec<usize>,
    }
    let mut facts: BTreeMap<_, Users> = BTreeMap::new();
    let mut fluents: BTreeMap<_, Users> = BTreeMap::new();
    for (position, footprint) in footprints.iter().enumerate() {
        for &fact in &footprint.reads {
            facts.entry(fact).or_default().readers.push(position);
        }
        for &fact in &footprint.adds {
            facts.entry(fact).or_default().adders.push(position);
        }
        for &fact in &footprint.deletes {
            facts.entry(fact).or_default().deleters.push(position);
        }
        for &fluent in &footprint.reads_fluents {
            fluents.entry(fluent).or_default().readers.push(position);
        }
        for &fluent in &footprint.shifts {
            fluents.entry(fluent).or_default().adders.push(position);
        }
        for &fluent in &footprint.assigns {
            fluents.entry(fluent).or_default().deleters.push(position);
        }
    }
    let mut pairs = BTreeSet::new();
    let mut cross = |left: &[usize], right: &[usize]| {
        for &a in left {
            for &b in right {
                if a != b {
                    pairs.insert((a.min(b), a.max(b)));
                }
            }
        }
    };
    for users in facts.values() {
        cross(&users.readers, &users.adders);
        cross(&users.readers, &users.deleters);
        cross(&users.adders, &users.deleters);
    }
    // For fluents, "adders" shift and "deleters" assign; assignments disturb each other too.
    for users in fluents.values() {
        cross(&users.readers, &users.adders);
        cross(&users.readers, &users.deleters);
        cross(&users.adders, &users.deleters);
        cross(&users.deleters, &users.deleters);
    }
    pairs
}
