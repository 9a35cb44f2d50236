//! Happenings that may need each other at one moment: [`Couplings`].
//!
//! Over-all conditions hold from right after the start of an action to right before its end. So two
//! simultaneous starts may each make the other's condition true, although neither can come first. A
//! happening *needs* another one at the same moment
//!
//! - if it starts an action, and the other one may make an over-all condition of that action true;
//! - if it may make an over-all condition of an action false, and the other one is the end of that
//!   action, or may make it true again;
//! - if it starts an action that may take no time, and the other one is that action's end: then no
//!   over-all condition is required.
//!
//! Happenings that need each other in a cycle are coupled. Others can always come one after the
//! other.

use std::collections::BTreeSet;

use elbowroom_model::ground::{Condition, Expression, FluentId};
use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;
use elbowroom_plan::{Node, NodeId};

use super::separations::Separations;
use super::{Candidates, OrderSearch};
use crate::model::{Event, Model, Requirement, Update, visit_facts};
use crate::network::PrunedNetwork;

/// Coupled happenings of a plan, computed once for all searches.
#[derive(Clone, Debug)]
pub(crate) struct Couplings {
    /// By node: those that it may need at the same moment.
    needs: Vec<BTreeSet<NodeId>>,
    /// By node: its group, if it is coupled with another one.
    groups: Vec<Option<usize>>,
}

impl Couplings {
    pub(crate) fn of(model: &Model, separations: &Separations) -> Self {
        let plan = model.plan();
        let mut needs = vec![BTreeSet::new(); plan.nodes.len()];
        let mut need = |one: NodeId, other: NodeId| {
            if one != other && !separations.must_be_separated(one, other) {
                needs[one.index()].insert(other);
            }
        };
        for (id, _) in plan.instances() {
            let (start, end) = (model.start(id), model.end(id));
            if start == end {
                continue;
            }
            let over_all = parts(model, start);
            if separations.durations[id.index()].0.is_zero() {
                need(end, start);
                if !over_all.is_empty() {
                    need(start, end);
                }
            }
            for part in &over_all {
                let making = |truth: bool| -> Vec<NodeId> {
                    let nodes = (1..plan.nodes.len()).map(NodeId::from);
                    let others = nodes.filter(|node| *node != end);
                    let may = |node: &NodeId| part.may_become(model, model.event(*node), truth);
                    others.filter(may).collect()
                };
                let (givers, breakers) = (making(true), making(false));
                if !part.is_made_by(model.event(start)) {
                    for giver in &givers {
                        need(start, *giver);
                    }
                }
                for breaker in breakers.into_iter().filter(|it| *it != start) {
                    need(breaker, end);
                    // The happening that makes a single fact true interferes.
                    if let Part::Condition(_) = part {
                        for giver in &givers {
                            need(breaker, *giver);
                        }
                    }
                }
            }
        }
        let groups = groups(&needs);
        Self { needs, groups }
    }

    /// Returns `true` if no happenings are coupled.
    pub(crate) fn is_empty(&self) -> bool {
        self.groups.iter().all(Option::is_none)
    }

    /// Returns `true` if a happening is coupled with another one.
    pub(crate) fn is_coupled(&self, node: NodeId) -> bool {
        self.groups[node.index()].is_some()
    }

    /// Returns `true` if two happenings are of the same group.
    pub(crate) fn are_coupled(&self, one: NodeId, other: NodeId) -> bool {
        let group = self.groups[one.index()];
        group.is_some() && group == self.groups[other.index()]
    }

    /// Returns `true` if `next` may be joined with `last`. At one moment, ends come first, as the world decides when they
    /// are, then timed initials, starts, and ends of actions that begin at that moment.
    pub(crate) fn may_be_joined(
        &self,
        nodes: &[Node],
        (last, next): (NodeId, NodeId),
        begins: &dyn Fn(NodeId) -> bool,
    ) -> bool {
        let rank = |node: NodeId| rank(nodes, node, begins);
        self.are_coupled(last, next) && rank(last) <= rank(next)
    }

    /// Sorts happenings of one moment so that each comes after those that it needs. Coupled ones stay together.
    pub(crate) fn sort(&self, model: &Model, moment: &mut Vec<NodeId>) {
        let nodes = &model.plan().nodes;
        let all = moment.clone();
        let begins = |node: NodeId| begins_in(model, node, &all);
        moment.sort_by_key(|&node| match nodes[node.index()] {
            // The end of an action that takes no time follows its start, unless others need to start in between.
            Node::End(id) if begins(node) && !self.is_coupled(node) => (2, model.start(id), node),
            _ => (rank(nodes, node, &begins), node, NodeId::ZERO),
        });
        let is_same = |one: NodeId, other: NodeId| one == other || self.are_coupled(one, other);
        let mut rest = std::mem::take(moment);
        while let Some(&first) = rest.first() {
            // A happening whose group needs none of the other ones. It exists, because groups do
            // not need each other in a cycle.
            let is_ready = |node: NodeId| {
                let mut group = rest.iter().filter(|other| is_same(node, **other));
                group.all(|own| {
                    let needed = &self.needs[own.index()];
                    let mut needed = needed.iter().filter(|other| rest.contains(other));
                    needed.all(|other| is_same(node, *other))
                })
            };
            let next = rest.iter().copied().find(|node| is_ready(*node));
            let next = next.unwrap_or(first);
            moment.extend(rest.iter().copied().filter(|other| is_same(next, *other)));
            rest.retain(|other| !is_same(next, *other));
        }
    }
}

impl OrderSearch {
    /// Returns those of the possible next happenings that may be joined with the last one, if it is
    /// open; `true` marks those that another happening has to follow at the same moment.
    pub(super) fn joinable(
        &self,
        network: &PrunedNetwork<'_>,
        next: Vec<NodeId>,
    ) -> Vec<(NodeId, bool)> {
        if self.couplings.is_empty() || self.settings.candidates == Candidates::All {
            return next.into_iter().map(|node| (node, false)).collect();
        }
        let nodes = &self.model.plan().nodes;
        let mut next = next;
        if let Some(last) = network.sequence().last().filter(|_| network.is_open()) {
            let moment = network.moment();
            let begins = |node: NodeId| begins_in(&self.model, node, moment);
            next.retain(|node| self.couplings.may_be_joined(nodes, (*last, *node), &begins));
        }
        let both = |node| {
            let may_be_open = self.couplings.is_coupled(node);
            let open = may_be_open.then_some((node, true));
            std::iter::once((node, false)).chain(open)
        };
        next.into_iter().flat_map(both).collect()
    }
}

/// Returns the rank of a happening among those of one moment.
fn rank(nodes: &[Node], node: NodeId, begins: &dyn Fn(NodeId) -> bool) -> u8 {
    match nodes[node.index()] {
        Node::End(_) if begins(node) => 3,
        Node::End(_) | Node::Zero => 0,
        Node::Timed(_) => 1,
        Node::Start(_) | Node::Instant(_) => 2,
    }
}

/// Returns `true` if a happening is the end of an action that begins at this moment.
fn begins_in(model: &Model, node: NodeId, moment: &[NodeId]) -> bool {
    match model.plan().nodes[node.index()] {
        Node::End(id) => moment.contains(&model.start(id)),
        _ => false,
    }
}

/// Part of an action's over-all condition.
enum Part {
    Literal(usize, bool),
    /// A condition on several facts, or on numbers.
    Condition(Condition),
}

/// Returns the parts of the over-all condition of the action that starts here, with the guards of
/// its effects.
fn parts(model: &Model, start: NodeId) -> Vec<Part> {
    let event = model.event(start);
    let Requirement {
        literals,
        numeric,
        coupled,
    } = &event.over_all;
    let literals = literals.iter();
    let literals = literals.map(|&(fact, truth)| Part::Literal(fact, truth));
    let coupled = coupled.iter().map(|coupled| &coupled.condition);
    let watched = event.guard_memories.iter().map(|(_, condition)| condition);
    let conditions = numeric.iter().chain(coupled).chain(watched);
    literals
        .chain(conditions.cloned().map(Part::Condition))
        .collect()
}

impl Part {
    /// Returns `true` if the effects of a happening may make this true, or false.
    fn may_become(&self, model: &Model, event: &Event, truth: bool) -> bool {
        match self {
            Self::Literal(fact, wanted) => {
                let becomes = *wanted == truth;
                let mut own = event.effects.iter().filter(|effect| effect.fact == *fact);
                own.any(|effect| effect.makes_true == becomes)
            }
            Self::Condition(condition) => may_become(model, event, condition, truth),
        }
    }

    /// Returns `true` if a happening makes this true independently of the previous state.
    fn is_made_by(&self, event: &Event) -> bool {
        let Self::Literal(fact, truth) = self else {
            return false;
        };
        let mut own = event.effects.iter().filter(|effect| effect.fact == *fact);
        own.all(|effect| effect.makes_true == *truth)
            && event.effects.iter().any(|effect| {
                effect.fact == *fact && effect.guard.is_none() && effect.probability >= 1.0
            })
    }
}

fn may_become(model: &Model, event: &Event, condition: &Condition, truth: bool) -> bool {
    match condition {
        Condition::Fact(fact) => {
            if let Some(position) = model.position(*fact) {
                let mut effects = event.effects.iter();
                return effects.any(|it| it.fact == position && it.makes_true == truth);
            }
            // A derived fact: either may result from any change.
            let mut reads = false;
            visit_facts(model.task(), condition, &mut |basic| {
                let position = model.position(basic);
                let mut effects = event.effects.iter();
                reads |= effects.any(|effect| Some(effect.fact) == position);
            });
            reads
        }
        Condition::Not(part) => may_become(model, event, part, !truth),
        Condition::And(parts) | Condition::Or(parts) => parts
            .iter()
            .any(|part| may_become(model, event, part, truth)),
        Condition::Compare(comparison, left, right) => {
            let updates = || event.updates.iter();
            let grows = |side: &Expression| updates().any(|it| may_grow(model, side, it, true));
            let falls = |side: &Expression| updates().any(|it| may_grow(model, side, it, false));
            let left_up = grows(left) || falls(right);
            let left_down = falls(left) || grows(right);
            match (comparison, truth) {
                (Comparison::Equal, _) => left_up || left_down,
                (Comparison::AtLeast | Comparison::Greater, true)
                | (Comparison::AtMost | Comparison::Less, false) => left_up,
                (Comparison::AtLeast | Comparison::Greater, false)
                | (Comparison::AtMost | Comparison::Less, true) => left_down,
            }
        }
    }
}

/// Returns `true` if an update may make an expression larger, or smaller.
fn may_grow(model: &Model, side: &Expression, update: &Update, larger: bool) -> bool {
    let fluent: FluentId = model.fluents[update.fluent];
    match side {
        Expression::Fluent(own) if *own == fluent => {
            let amount = match &update.value {
                Expression::Constant(amount) => Some(amount),
                _ => None,
            };
            let up = match (update.operator, amount) {
                (UpdateOperator::Increase, Some(amount)) => *amount > Rational::ZERO,
                (UpdateOperator::Decrease, Some(amount)) => *amount < Rational::ZERO,
                _ => return true,
            };
            up == larger
        }
        Expression::Add(parts) => parts
            .iter()
            .any(|part| may_grow(model, part, update, larger)),
        Expression::Subtract(left, right) => {
            may_grow(model, left, update, larger) || may_grow(model, right, update, !larger)
        }
        _ => {
            let mut reads = false;
            let _ = side.map_leaves(&mut |leaf| {
                reads |= matches!(leaf, Expression::Fluent(own) if *own == fluent);
                None
            });
            reads
        }
    }
}

/// Returns the strongly connected components with more than one node.
fn groups(needs: &[BTreeSet<NodeId>]) -> Vec<Option<usize>> {
    let reachable = |from: usize| {
        let mut seen = vec![false; needs.len()];
        let mut open = vec![from];
        while let Some(node) = open.pop() {
            for next in &needs[node] {
                if !std::mem::replace(&mut seen[next.index()], true) {
                    open.push(next.index());
                }
            }
        }
        seen
    };
    let has_needs = |node: usize| !needs[node].is_empty();
    let closure: Vec<Vec<bool>> = (0..needs.len())
        .map(|node| {
            if has_needs(node) {
                reachable(node)
            } else {
                Vec::new()
            }
        })
        .collect();
    let reaches = |from: usize, to: usize| closure[from].get(to) == Some(&true);
    (0..needs.len())
        .map(|node| (0..needs.len()).find(|other| reaches(node, *other) && reaches(*other, node)))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use elbowroom_plan::NodeId;

    use super::groups;

    #[test]
    fn nodes_of_a_cycle_form_one_component() {
        let needs = |nodes: &[usize]| nodes.iter().copied().map(NodeId::from).collect();
        let graph: Vec<BTreeSet<NodeId>> = vec![
            needs(&[1]),
            needs(&[2]),
            needs(&[0, 3]),
            needs(&[]),
            needs(&[5, 3]),
            needs(&[4]),
        ];
        let expected = [Some(0), Some(0), Some(0), None, Some(4), Some(4)];
        assert_eq!(groups(&graph), expected);
    }
}
