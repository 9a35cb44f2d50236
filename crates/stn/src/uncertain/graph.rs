//! Graph of a network, for the check of dynamic controllability.

use std::num::NonZero;

use super::conflict::{Ground, Step};
use super::extended::Extended;
use super::order::Order;
use super::{LinkId, UncertainNetwork};
use crate::{ConstraintId, NodeId, Weight, count_step};

/// Identifier of an edge: its position in [`Graph::edges`].
pub(super) type EdgeId = usize;

/// `to - from <= bound`; for a wait, only until the link has ended.
#[derive(Clone, Debug)]
pub(super) struct Edge<W> {
    pub(super) from: NodeId,
    pub(super) to: NodeId,
    pub(super) bound: Extended<W>,
    pub(super) kind: Kind,
    pub(super) origin: Origin,
}

/// Label of an edge: the condition for it to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// It always holds.
    Plain,
    /// It holds if the link ends early.
    Lower(LinkId),
    /// It holds until the link has ended.
    Upper(LinkId),
}

/// The origin of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    Requirement(ConstraintId),
    Link(LinkId),
    /// Derived from a path.
    Path(PathId),
}

/// Redundant edges are detected if the search has found more than `FEW` times the network's own
/// edges, or if the network has at most `SMALL` edges.
const REDUNDANCY_FACTOR: usize = 2;
const SMALL_GRAPH: usize = 100;

/// Identifier of a path: its position in [`Graph::ways`].
pub(super) type PathId = usize;

/// An edge, and the path that follows it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    edge: u32,
    /// One more than the identifier of the path.
    rest: Option<NonZero<u32>>,
}

impl Path {
    /// Creates a path from an edge and the path that follows it. Numbers are stored in 32 bits,
    /// because a network may have millions of paths.
    pub(super) fn new(edge: EdgeId, rest: Option<PathId>) -> Self {
        let short = |number: usize| u32::try_from(number).expect("fewer than 2^32 ways");
        Self {
            edge: short(edge),
            rest: rest.and_then(|way| NonZero::new(short(way + 1))),
        }
    }

    pub(super) fn edge(self) -> EdgeId {
        self.edge as usize
    }

    pub(super) fn rest(self) -> Option<PathId> {
        self.rest.map(|way| way.get() as usize - 1)
    }
}

/// The network as a graph, with the edges found.
#[derive(Clone, Debug)]
pub(super) struct Graph<W> {
    pub(super) edges: Vec<Edge<W>>,
    pub(super) paths: Vec<Path>,
    /// For each node, the edges that end there and are not negative, except upper-case ones: those
    /// of the network, then those found.
    pub(super) positive_into: Vec<Vec<EdgeId>>,
    /// For each node, the negative plain edges of the network that end there.
    pub(super) negative_into: Vec<Vec<EdgeId>>,
    /// For each node, the upper-case edges of the network that end there.
    pub(super) upper_into: Vec<Vec<EdgeId>>,
    /// For each node, the nodes that always come before it, because a negative edge of the network
    /// leads to them, plain or of a link. (The edge of a link with duration 0 is not negative.)
    earlier: Vec<Vec<NodeId>>,
    /// Order that follows from `earlier`, computed on first use.
    order: Option<Order>,
    /// `true` if redundant edges are kept as well.
    pub(super) is_full: bool,
    /// The number of the network's own edges: two for each link, after those of the requirements.
    pub(super) given_edges: usize,
}

impl<W: Weight> Graph<W> {
    pub(super) fn new(network: &UncertainNetwork<W>) -> Self {
        let count = network.requirements.node_count();
        let mut graph = Self {
            edges: Vec::with_capacity(network.requirements.constraints().len()),
            paths: Vec::new(),
            positive_into: vec![Vec::new(); count],
            negative_into: vec![Vec::new(); count],
            upper_into: vec![Vec::new(); count],
            earlier: vec![Vec::new(); count],
            order: None,
            is_full: false,
            given_edges: 0,
        };
        for id in network.requirements.constraint_ids() {
            let constraint = network.requirements.constraint(id);
            if constraint.bound < W::zero() {
                graph.earlier[constraint.from.index()].push(constraint.to);
            }
            graph.add(Edge {
                from: constraint.from,
                to: constraint.to,
                bound: constraint.bound.clone().into(),
                kind: Kind::Plain,
                origin: Origin::Requirement(id),
            });
        }
        for id in network.link_ids() {
            let link = network.link(id);
            graph.add(Edge {
                from: link.activation,
                to: link.end,
                bound: link.lower.clone().into(),
                kind: Kind::Lower(id),
                origin: Origin::Link(id),
            });
            let upper = link
                .upper
                .clone()
                .map_or_else(Extended::infinity, Into::into);
            let is_upper = upper > Extended::zero();
            if is_upper {
                graph.earlier[link.end.index()].push(link.activation);
            }
            graph.add(Edge {
                from: link.end,
                to: link.activation,
                bound: upper.negated(),
                // The backward edge of a link with duration 0 is plain.
                kind: if is_upper {
                    Kind::Upper(id)
                } else {
                    Kind::Plain
                },
                origin: Origin::Link(id),
            });
        }
        graph.given_edges = graph.edges.len();
        graph
    }

    /// Returns the lower-case and the upper-case edge of a link.
    pub(super) fn edges_of(&self, network: &UncertainNetwork<W>, link: LinkId) -> [EdgeId; 2] {
        let first = self.given_edges - 2 * (network.links.len() - link.index());
        [first, first + 1]
    }

    /// Returns the same graph with another number type. It cannot be searched any more.
    pub(super) fn map<V>(self, number: impl Fn(W) -> V) -> Graph<V> {
        drop([self.positive_into, self.negative_into, self.upper_into]);
        let edges = self.edges.into_iter().map(|edge| Edge {
            from: edge.from,
            to: edge.to,
            bound: edge.bound.map(&number),
            kind: edge.kind,
            origin: edge.origin,
        });
        Graph {
            edges: edges.collect(),
            paths: self.paths,
            positive_into: Vec::new(),
            negative_into: Vec::new(),
            upper_into: Vec::new(),
            earlier: Vec::new(),
            order: None,
            is_full: self.is_full,
            given_edges: self.given_edges,
        }
    }

    pub(super) fn add(&mut self, edge: Edge<W>) -> EdgeId {
        let id = self.edges.len();
        let to = edge.to.index();
        match edge.kind {
            Kind::Upper(_) => self.upper_into[to].push(id),
            Kind::Plain if edge.bound.is_negative() => self.negative_into[to].push(id),
            Kind::Plain | Kind::Lower(_) => self.positive_into[to].push(id),
        }
        self.edges.push(edge);
        id
    }

    /// Returns `true` if a node comes after another in every execution. Always `false` while the
    /// search has found few edges in a large network, because the computation would not pay off.
    pub(super) fn is_after(&mut self, later: NodeId, first: NodeId) -> bool {
        let is_little = self.given_edges > SMALL_GRAPH
            && self.edges.len() <= REDUNDANCY_FACTOR * self.given_edges;
        if self.is_full || is_little {
            return false;
        }
        let order = self.order.get_or_insert_with(|| Order::new(&self.earlier));
        order.is_after(later, first)
    }

    /// Appends the edges of the network that an edge is derived from, from its `from` to its `to`,
    /// at most `most`.
    ///
    /// Returns `true` if these are all.
    pub(super) fn expand(&self, edge: EdgeId, most: usize, into: &mut Vec<EdgeId>) -> bool {
        let mut stack = vec![edge];
        while let Some(id) = stack.pop() {
            let Origin::Path(way) = self.edges[id].origin else {
                if into.len() >= most {
                    return false;
                }
                into.push(id);
                continue;
            };
            let mut along = Vec::new();
            let mut next = Some(way);
            while let Some(way) = next {
                count_step();
                along.push(self.paths[way].edge());
                next = self.paths[way].rest();
            }
            stack.extend(along.into_iter().rev());
        }
        true
    }

    /// Returns the step of a conflict for an edge of the network.
    pub(super) fn step(&self, id: EdgeId) -> Step<W> {
        let edge = &self.edges[id];
        let ground = match (edge.kind, edge.origin) {
            (_, Origin::Requirement(id)) => Ground::Requirement(id),
            (Kind::Lower(link), _) => Ground::Early(link),
            (Kind::Upper(link), _) | (_, Origin::Link(link)) => Ground::Late(link),
            (_, Origin::Path(_)) => unreachable!("ways are spelt out"),
        };
        Step {
            from: edge.from,
            to: edge.to,
            bound: edge.bound.clone(),
            ground,
        }
    }
}
