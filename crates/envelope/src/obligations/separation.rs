//! Separation of interfering happenings by ε.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_model::{Footprint, Task};

use super::{BadCase, Difference, Obligation, Requirement};
use elbowroom_plan::{Bound, Node, NodeId, StnPlan};

/// Returns the separations of all pairs of interfering happenings, except those implied by others.
///
/// `order` lists all nodes in nominal order. If `a` is ε before `b` and `b` is ε before `c`, then
/// `a` is before `c`: only pairs without such a detour are obligations of their own. Pairs of timed
/// initials at fixed times are left out as well, because the plan does not decide when they happen.
pub(super) fn separations(task: &Task, plan: &StnPlan, order: &[NodeId]) -> Vec<Obligation> {
    let fixed = fixed(plan);
    interfering_in_order(task, plan, order)
        .into_iter()
        .filter(|(first, second)| !fixed.contains(first) || !fixed.contains(second))
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

/// Returns the groups of timed initials at times that depend on no parameter.
fn fixed(plan: &StnPlan) -> BTreeSet<NodeId> {
    let at_fixed_times = plan.constraints.iter().filter(|constraint| {
        constraint.from == NodeId::ZERO
            && matches!(plan.nodes[constraint.to.index()], Node::Timed(_))
            && constraint.lower == constraint.upper
            && matches!(constraint.lower, Bound::Finite(_))
    });
    at_fixed_times.map(|constraint| constraint.to).collect()
}

/// Returns the interfering pairs, earlier node first, except those connected through a third node.
pub(crate) fn interfering_in_order(
    task: &Task,
    plan: &StnPlan,
    order: &[NodeId],
) -> Vec<(NodeId, NodeId)> {
    let footprints = order.iter().map(|&node| plan.footprint(task, node));
    let pairs = nearest_pairs(footprints).into_iter();
    pairs
        .map(|(first, later)| (order[first], order[later]))
        .collect()
}

/// Returns the positions of interfering footprints, the earlier one first, except those connected
/// through others.
fn nearest_pairs(footprints: impl Iterator<Item = Footprint>) -> Vec<(usize, usize)> {
    let mut neighbours = Neighbours::default();
    let mut links: Vec<Vec<usize>> = Vec::new();
    for (later, footprint) in footprints.enumerate() {
        links.push(nearest(&neighbours.before(later, &footprint), &links));
    }
    let pairs = links.iter().enumerate();
    pairs
        .flat_map(|(later, links)| links.iter().map(move |&first| (first, later)))
        .collect()
}

/// Returns the candidates that are not reachable along `links` from other candidates, latest first.
fn nearest(candidates: &BTreeSet<usize>, links: &[Vec<usize>]) -> Vec<usize> {
    let mut nearest = Vec::new();
    let mut reached = BTreeSet::new();
    let mut open = candidates.clone();
    let mut undecided = candidates.len();
    // Processed from the latest position on, so that all paths to a position are explored before
    // it.
    while undecided > 0
        && let Some(position) = open.pop_last()
    {
        if candidates.contains(&position) && !reached.contains(&position) {
            nearest.push(position);
            undecided -= 1;
        }
        for &earlier in &links[position] {
            if reached.insert(earlier) {
                open.insert(earlier);
                undecided -= usize::from(candidates.contains(&earlier));
            }
        }
    }
    nearest
}

/// Kind of access of a happening to a fact or fluent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Access {
    Read,
    /// A fact becomes true; a fluent is shifted.
    Add,
    /// A fact becomes false.
    Delete,
    /// A fluent gets a value.
    Assign,
}

/// Latest users of a fact or fluent.
///
/// Users with one kind of access are compatible with users of the same kind, unless they assign;
/// all other pairs interfere. So users form blocks. Each user interferes with all users of the
/// previous block, and transitively with all earlier ones that are not of its own kind.
#[derive(Clone, Debug, Default)]
struct AccessBlocks {
    previous: Vec<usize>,
    last: Vec<usize>,
    /// The common kind of access in the last block, if its users are compatible.
    together: Option<Access>,
}

impl AccessBlocks {
    /// Adds a user. Returns the earlier users that it interferes with, except those that precede
    /// these transitively.
    fn add(&mut self, position: usize, uses: &[Access]) -> &[usize] {
        let together = match uses {
            [Access::Assign] => None,
            [only] => Some(*only),
            _ => None,
        };
        if together.is_none() || together != self.together {
            self.previous = std::mem::take(&mut self.last);
            self.together = together;
        }
        self.last.push(position);
        &self.previous
    }
}

/// Finds interfering happenings through an index of the facts and fluents they use.
#[derive(Default)]
struct Neighbours {
    facts: BTreeMap<FactId, AccessBlocks>,
    fluents: BTreeMap<FluentId, AccessBlocks>,
}

impl Neighbours {
    /// Returns the earlier positions that this one interferes with, except those connected through
    /// others.
    fn before(&mut self, position: usize, footprint: &Footprint) -> BTreeSet<usize> {
        let mut facts: BTreeMap<FactId, Vec<Access>> = BTreeMap::new();
        let of_facts = [
            (&footprint.reads, Access::Read),
            (&footprint.adds, Access::Add),
            (&footprint.deletes, Access::Delete),
        ];
        for (used, own) in of_facts {
            for &fact in used {
                facts.entry(fact).or_default().push(own);
            }
        }
        let mut fluents: BTreeMap<FluentId, Vec<Access>> = BTreeMap::new();
        let of_fluents = [
            (&footprint.reads_fluents, Access::Read),
            (&footprint.shifts, Access::Add),
            (&footprint.assigns, Access::Assign),
        ];
        for (used, own) in of_fluents {
            for &fluent in used {
                fluents.entry(fluent).or_default().push(own);
            }
        }
        let mut before = BTreeSet::new();
        for (fact, uses) in facts {
            before.extend(self.facts.entry(fact).or_default().add(position, &uses));
        }
        for (fluent, uses) in fluents {
            before.extend(self.fluents.entry(fluent).or_default().add(position, &uses));
        }
        before
    }
}

#[cfg(test)]
mod tests;
