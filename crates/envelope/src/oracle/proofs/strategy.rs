//! The dispatchable form of a plan's network in a box.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, NodeId, ParametrizedPlan};
use elbowroom_stn::NodeId as NetworkNode;

use crate::proof::Strategy;

/// Returns the constraints that an executor has to satisfy in addition to the plan's own; `None` if
/// the network is not dynamically controllable.
pub(super) fn strategy(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<Strategy> {
    let plan_network = plan.uncertain_network(envelope).ok()?;
    let network = &plan_network.network;
    let form = network.dynamic().ok()?;
    let mut given: BTreeMap<(NetworkNode, NetworkNode), Rational> = BTreeMap::new();
    let tighten = |known: &mut BTreeMap<_, Rational>, from, to, bound: &Rational| {
        let own = known.entry((from, to)).or_insert_with(|| bound.clone());
        if bound < own {
            own.clone_from(bound);
        }
    };
    for constraint in network.requirements().constraints() {
        tighten(
            &mut given,
            constraint.from,
            constraint.to,
            &constraint.bound,
        );
    }
    for link in network.links() {
        if link.upper.as_ref() == Some(&link.lower) {
            tighten(&mut given, link.end, link.activation, &-&link.lower);
        }
    }
    let mut known = given.clone();
    for edge in form.edges().filter(|edge| edge.from != edge.to) {
        tighten(&mut known, edge.from, edge.to, edge.bound);
    }
    let found = known
        .iter()
        .filter(|(ends, bound)| given.get(*ends) != Some(*bound));
    let edges = found.map(|(&(from, to), bound)| (node(from), node(to), bound.clone()));

    // The longest wait for each node and duration; a wait without limit is the longest.
    let mut waits: BTreeMap<(NodeId, usize), Option<Rational>> = BTreeMap::new();
    for (waiting, link, delay) in form.derived_waits() {
        let own = network.link(link);
        let is_longer = delay.as_ref().is_none_or(|delay| *delay > own.lower);
        if waiting == own.end || !is_longer {
            continue;
        }
        let place = (node(waiting), plan_network.links[link.index()]);
        let known = waits.entry(place).or_insert_with(|| delay.clone());
        *known = known
            .take()
            .zip(delay)
            .map(|(known, delay)| known.max(delay));
    }
    let waits = waits.into_iter();
    Some(Strategy {
        edges: edges.collect(),
        waits: waits
            .map(|((node, link), delay)| (node, link, delay))
            .collect(),
    })
}

/// Converts a node; its position is the same.
fn node(node: NetworkNode) -> NodeId {
    NodeId::from(node.index())
}
