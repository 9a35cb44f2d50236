//! Incremental check of dynamic controllability, after the bounds of one link have changed.

use super::dynamic::{Search, Stage};
use super::extended::Extended;
use super::graph::{EdgeId, Graph};
use super::{Conflict, LinkId, UncertainNetwork};
use crate::{NodeId, Weight};

/// Limit on unused results of earlier searches, as a multiple of one search's results.
const MAX_LEFTOVERS: usize = 4;

/// Dynamically controllable network that supports changes of link bounds, one link at a time.
///
/// The edges found for a negative node depend on the nodes through which negative paths lead to it,
/// and on the edges that end at these. Only nodes that depend on the link, directly or indirectly,
/// are searched again. In the networks of plans these are few.
#[derive(Clone, Debug)]
pub struct Recheck<W> {
    network: UncertainNetwork<W>,
    graph: Graph<W>,
    /// For each node, the nodes through which negative paths lead to it.
    regions: Vec<Vec<NodeId>>,
    /// For each node, the number of the network's own edges that end there and are not negative.
    given: Vec<usize>,
    /// Number of edges and paths that the last search of the whole network found.
    fresh: usize,
}

/// The earlier result for a node that is processed again.
struct EarlierResult {
    node: NodeId,
    found: Vec<EdgeId>,
    region: Vec<NodeId>,
}

impl<W: Weight> Recheck<W> {
    /// Checks the network.
    ///
    /// # Errors
    /// The cycle that shows that it is not dynamically controllable.
    pub fn new(network: UncertainNetwork<W>) -> Result<Self, Conflict<W>> {
        let mut graph = Graph::new(&network);
        let given = graph.positive_into.iter().map(Vec::len).collect();
        let mut search = Search::new(&network, &mut graph, false);
        for node in network.requirements.nodes() {
            search.settle(node)?;
        }
        let regions = search.regions;
        Ok(Self {
            fresh: graph.edges.len() + graph.paths.len(),
            network,
            graph,
            regions,
            given,
        })
    }

    /// Returns the network, with the bounds accepted last.
    pub fn network(&self) -> &UncertainNetwork<W> {
        &self.network
    }

    /// Changes the bounds of a link, if the network stays dynamically controllable.
    ///
    /// # Errors
    /// The cycle that shows that it does not; the network stays as it was.
    ///
    /// # Panics
    /// If the bounds are not in order, or the lower one is negative.
    pub fn change(&mut self, id: LinkId, lower: W, upper: Option<W>) -> Result<(), Conflict<W>> {
        let is_in_order = upper.as_ref().is_none_or(|upper| lower <= *upper);
        assert!(lower >= W::zero() && is_in_order, "the bounds of a link");
        let link = self.network.links[id.index()].clone();
        let takes_time = |upper: &Option<W>| *upper != Some(W::zero());
        if takes_time(&link.upper) != takes_time(&upper) {
            // The edges of a link with duration 0 are of another kind.
            let mut network = self.network.clone();
            network.links[id.index()].lower = lower;
            network.links[id.index()].upper = upper;
            *self = Self::new(network)?;
            return Ok(());
        }
        let mut first = vec![link.activation];
        if lower != link.lower {
            // Ways through the link's end may continue along its lower-case edge.
            first.extend(self.nodes_through(link.end));
        }
        let dirty = self.depending_on(first);
        let old = (link.lower, link.upper);
        self.set(id, lower, upper);
        let sizes = (self.graph.edges.len(), self.graph.paths.len());
        let before = self.reset_nodes(&dirty);

        let mut search = Search::new(&self.network, &mut self.graph, false);
        search.stage.fill(Stage::Done);
        for node in &dirty {
            search.stage[node.index()] = Stage::New;
        }
        let found = dirty.iter().try_for_each(|node| search.settle(*node));
        let mut regions = search.regions;
        if let Err(conflict) = found {
            self.graph.edges.truncate(sizes.0);
            self.graph.paths.truncate(sizes.1);
            for EarlierResult {
                node,
                found,
                region,
            } in before
            {
                let into = &mut self.graph.positive_into[node.index()];
                into.truncate(self.given[node.index()]);
                into.extend(found);
                self.regions[node.index()] = region;
            }
            self.set(id, old.0, old.1);
            return Err(conflict);
        }
        for node in dirty {
            self.regions[node.index()] = std::mem::take(&mut regions[node.index()]);
        }
        if self.graph.edges.len() + self.graph.paths.len() > MAX_LEFTOVERS * self.fresh {
            *self = Self::new(self.network.clone())?;
        }
        Ok(())
    }

    fn set(&mut self, id: LinkId, lower: W, upper: Option<W>) {
        let [early, late] = self.graph.edges_of(&self.network, id);
        self.graph.edges[early].bound = lower.clone().into();
        let most = upper.clone().map_or_else(Extended::infinity, Into::into);
        self.graph.edges[late].bound = most.negated();
        let link = &mut self.network.links[id.index()];
        (link.lower, link.upper) = (lower, upper);
    }

    /// Removes the edges found for these nodes, and returns them.
    fn reset_nodes(&mut self, nodes: &[NodeId]) -> Vec<EarlierResult> {
        let before = nodes.iter().map(|&node| EarlierResult {
            node,
            found: self.graph.positive_into[node.index()].split_off(self.given[node.index()]),
            region: std::mem::take(&mut self.regions[node.index()]),
        });
        before.collect()
    }

    /// Returns the nodes to which negative paths lead through `node`.
    fn nodes_through(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        let nodes = self.network.requirements.nodes();
        nodes.filter(move |other| self.regions[other.index()].contains(&node))
    }

    /// Returns these nodes and all that depend on them, in order.
    fn depending_on(&self, mut open: Vec<NodeId>) -> Vec<NodeId> {
        let count = self.network.requirements.node_count();
        let mut dependants = vec![Vec::new(); count];
        for node in self.network.requirements.nodes() {
            for by in &self.regions[node.index()] {
                dependants[by.index()].push(node);
            }
        }
        let mut depends = vec![false; count];
        while let Some(node) = open.pop() {
            if !std::mem::replace(&mut depends[node.index()], true) {
                open.extend_from_slice(&dependants[node.index()]);
            }
        }
        let nodes = self.network.requirements.nodes();
        nodes.filter(|node| depends[node.index()]).collect()
    }
}
