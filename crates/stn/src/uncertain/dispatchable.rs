//! Dispatchable form of a network, for event-by-event execution.

use super::graph::{EdgeId, Graph, Kind, Origin};
use super::{Extended, Ground, LinkId, Step, UncertainNetwork};
use crate::{Constraint, Network, NodeId, Weight};

/// The limit on the steps in the explanation of an edge.
const MAX_STEPS: usize = 1_000;

/// Dynamically controllable network with all edges needed for its execution: each event has to be
/// propagated to its neighbours only (Morris 2014; Hunsberger & Posenato, ICAART 2024, call it an
/// *ESTNU*).
///
/// An executor that respects these edges satisfies every requirement, whatever the world does
/// within the bounds of the contingent links. [`Dispatcher`](super::Dispatcher) is such an
/// executor.
#[derive(Clone, Debug)]
pub struct Dispatchable<W> {
    network: UncertainNetwork<W>,
    graph: Graph<W>,
    /// For each node, the plain edges that begin and those that end there, infinite ones excepted.
    leaving: Vec<Vec<EdgeId>>,
    entering: Vec<Vec<EdgeId>>,
    /// For each node, the waits that begin when it happens.
    waits_at: Vec<Vec<Wait<W>>>,
    /// For each node, the nodes that must have happened before it. The dispatcher does not enforce
    /// the entries of nodes that the world decides on.
    before: Vec<Vec<NodeId>>,
    /// For each node, the nodes that must not happen later than it, but may happen at the same
    /// time, if no other edge ensures that; each with its edge.
    not_after: Vec<Vec<(NodeId, EdgeId)>>,
}

/// `to - from <= bound`, from the network or derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DispatchableEdge<'a, W> {
    /// The time point that is subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// The upper bound of the difference.
    pub bound: &'a W,
}

/// Once the link is activated, `node` waits until its end has happened, but not longer than
/// `delay` after the activation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wait<W> {
    /// The node that has to wait.
    pub node: NodeId,
    /// The link whose end it waits for.
    pub link: LinkId,
    /// Longest wait after the activation; `None` if only the link's end can end it.
    pub delay: Option<W>,
    pub(super) edge: EdgeId,
}

impl<W: Weight> Dispatchable<W> {
    pub(super) fn new(network: UncertainNetwork<W>, graph: Graph<W>) -> Self {
        let count = network.requirements.node_count();
        let mut form = Self {
            leaving: vec![Vec::new(); count],
            entering: vec![Vec::new(); count],
            waits_at: vec![Vec::new(); count],
            before: vec![Vec::new(); count],
            not_after: vec![Vec::new(); count],
            network,
            graph,
        };
        for (id, edge) in form.graph.edges.iter().enumerate() {
            let (from, to) = (edge.from, edge.to);
            match edge.kind {
                Kind::Plain if edge.bound.infinite == 0 && from != to => {
                    form.leaving[from.index()].push(id);
                    form.entering[to.index()].push(id);
                    if edge.bound.is_negative() {
                        form.before[from.index()].push(to);
                    }
                    // A link with duration 0: its end is as late as its activation.
                    let is_link = matches!(edge.origin, Origin::Link(_));
                    if is_link && edge.bound == Extended::zero() {
                        form.not_after[from.index()].push((to, id));
                    }
                }
                Kind::Upper(link) if form.network.ending_at(from) != Some(link) => {
                    form.before[from.index()].push(to);
                    form.waits_at[to.index()].push(Wait {
                        node: from,
                        link,
                        delay: edge.bound.negated().into_finite(),
                        edge: id,
                    });
                }
                _ => {}
            }
        }
        form.add_zero_bound_predecessors();
        for before in &mut form.before {
            before.sort_unstable();
            before.dedup();
        }
        form
    }

    /// Makes nodes wait for nodes that are required to be earlier or simultaneous. A requirement
    /// with bound 0 does not fix the order of simultaneous events. Nodes that must be simultaneous
    /// do not wait for each other, but each of them waits for nodes that the world decides on.
    fn add_zero_bound_predecessors(&mut self) {
        let together = self.simultaneous_groups();
        let requirements = &self.network.requirements;
        // The requirements are the first edges.
        for (edge, constraint) in requirements.constraints().iter().enumerate() {
            let (later, first) = (constraint.from, constraint.to);
            let is_together = together[later.index()] == together[first.index()];
            if later == first
                || constraint.bound != W::zero()
                || self.network.is_contingent(later)
                || (is_together && !self.is_uncontrolled(first))
            {
                continue;
            }
            self.before[later.index()].push(first);
            if !self.is_uncontrolled(first) {
                self.not_after[later.index()].push((first, edge));
            }
        }
    }

    /// Returns the nodes that have to have happened by the node's own latest time.
    pub(super) fn not_after(&self, node: NodeId) -> &[(NodeId, EdgeId)] {
        &self.not_after[node.index()]
    }

    /// Returns `true` if the world can choose when a node happens.
    fn is_uncontrolled(&self, node: NodeId) -> bool {
        let mut at = node;
        while let Some(link) = self.network.ending_at(at) {
            let link = self.network.link(link);
            if link.upper != Some(W::zero()) {
                return true;
            }
            at = link.activation;
        }
        false
    }

    /// Returns a number for each node; nodes that have to happen at the same time share it.
    fn simultaneous_groups(&self) -> Vec<usize> {
        let requirements = self.network.requirements.constraints().iter();
        let mut zero = Network::with_nodes(self.network.requirements.node_count());
        for constraint in requirements.filter(|constraint| constraint.bound == W::zero()) {
            zero.add(constraint.clone());
        }
        for link in &self.network.links {
            if link.upper == Some(W::zero()) {
                zero.add(Constraint::at_most(link.activation, link.end, W::zero()));
                zero.add(Constraint::at_least(link.activation, link.end, W::zero()));
            }
        }
        zero.components()
    }

    /// Returns the network that this is the dispatchable form of.
    pub fn network(&self) -> &UncertainNetwork<W> {
        &self.network
    }

    /// Returns all edges that the executor has to respect, those of the network first. The bounds
    /// of contingent links are not included.
    pub fn edges(&self) -> impl Iterator<Item = DispatchableEdge<'_, W>> {
        self.graph
            .edges
            .iter()
            .filter(|edge| edge.kind == Kind::Plain && edge.bound.infinite == 0)
            .filter(|edge| !matches!(edge.origin, Origin::Link(_)))
            .map(|edge| DispatchableEdge {
                from: edge.from,
                to: edge.to,
                bound: &edge.bound.finite,
            })
    }

    /// Returns all waits of nodes that the executor chooses, by the node that activates their link.
    pub fn waits(&self) -> impl Iterator<Item = (NodeId, &Wait<W>)> {
        let nodes = self.network.requirements.nodes();
        nodes.flat_map(|node| {
            self.waits_at[node.index()]
                .iter()
                .filter(|wait| !self.network.is_contingent(wait.node))
                .map(move |wait| (node, wait))
        })
    }

    /// Returns all derived waits, except those of links for their own ends: the node, the link
    /// whose end it waits for, and the longest wait after the link's activation; `None` is without
    /// limit.
    ///
    /// Includes waits of nodes that the world decides on. No executor enforces these, but other
    /// waits are derived from them.
    pub fn derived_waits(&self) -> impl Iterator<Item = (NodeId, LinkId, Option<W>)> {
        self.graph.edges.iter().filter_map(|edge| match edge.kind {
            Kind::Upper(link) if !matches!(edge.origin, Origin::Link(_)) => {
                Some((edge.from, link, edge.bound.negated().into_finite()))
            }
            _ => None,
        })
    }

    /// Returns the waits that begin when a node happens, including those of nodes that the world
    /// decides on.
    pub(super) fn waits_at(&self, node: NodeId) -> &[Wait<W>] {
        &self.waits_at[node.index()]
    }

    /// Returns the nodes that must have happened before a node. If the world decides when the node
    /// happens, it respects that order as long as links stay within their bounds.
    pub fn before(&self, node: NodeId) -> &[NodeId] {
        &self.before[node.index()]
    }

    /// Returns the edges that begin at a node: target, length, identifier.
    pub(super) fn leaving(&self, node: NodeId) -> impl Iterator<Item = (NodeId, &W, EdgeId)> {
        self.leaving[node.index()].iter().map(|&id| {
            let edge = &self.graph.edges[id];
            (edge.to, &edge.bound.finite, id)
        })
    }

    /// Returns the edges that end at a node: source, length, identifier.
    pub(super) fn entering(&self, node: NodeId) -> impl Iterator<Item = (NodeId, &W, EdgeId)> {
        self.entering[node.index()].iter().map(|&id| {
            let edge = &self.graph.edges[id];
            (edge.from, &edge.bound.finite, id)
        })
    }

    /// Returns the path that implies an edge, from its beginning to its end.
    pub(super) fn implying_path(&self, edge: EdgeId) -> Vec<Step<W>> {
        let mut edges = Vec::new();
        self.graph.expand(edge, MAX_STEPS, &mut edges);
        edges.into_iter().map(|id| self.graph.step(id)).collect()
    }

    /// Returns the requirements among steps, in order.
    pub fn requirements_of(steps: &[Step<W>]) -> impl Iterator<Item = crate::ConstraintId> {
        steps.iter().filter_map(|step| match step.ground {
            Ground::Requirement(id) => Some(id),
            Ground::Early(_) | Ground::Late(_) => None,
        })
    }
}
