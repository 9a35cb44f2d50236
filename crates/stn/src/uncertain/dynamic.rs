//! Dynamic controllability, by the algorithm of Morris (2014).
//!
//! In the graph, a requirement is an edge, and a link `[x, y]` from `A` to `C` is two edges: a
//! *lower-case* edge `A --x--> C` ("C may come as early as that") and an *upper-case* edge `C
//! --y--> A` of length `-y` ("C may come as late as that"). The network is dynamically controllable
//! unless there is a semi-reducible cycle of negative length. The search for such a cycle runs
//! backwards from each *negative node* (the end of an edge of negative length), along edges that
//! are not negative, until the path is no longer negative. Each path found becomes an edge, so that
//! it is not searched again. A negative node on the path is processed first. If it is already being
//! processed, the paths form a cycle.
//!
//! A path that begins with an upper-case edge holds only until the link's end has happened. Its
//! edges are *waits*, unless they are so long that the link cannot end earlier. Such paths are
//! searched first, separately, and may not use the lower-case edge of the same link.
//!
//! The edges found make the network dispatchable: for every positive edge followed by a negative
//! one, there is an edge that bypasses both (*Dynamic Controllability and Dispatchability
//! Relationships*, CPAIOR 2014, which normalises links to lower bound 0; here the lower bound is
//! kept, and the waits shorter than it become plain edges).
//!
//! An edge found that is not negative is an upper limit on the time from its beginning to its end.
//! If the end always comes first, the edge is redundant. So is a wait of a node that always comes
//! after the link's end. If many edges are found, redundant ones are left out, unless all are
//! requested. The form stays dispatchable without them: an event that such an edge would constrain
//! comes after the other event anyway, and so do all its successors. If many nodes wait only
//! because they come after much earlier events, nearly all edges are redundant.
//!
//! O(n³) at worst (Dijkstra's algorithm for each negative node). In the networks of plans, where
//! paths end after a few edges, the time is in proportion to their size.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};
use std::ops::ControlFlow;

use super::conflict::Conflict;
use super::dispatchable::Dispatchable;
use super::extended::Extended;
use super::graph::{Edge, EdgeId, Graph, Kind, Origin, Path, PathId};
use super::{LinkId, UncertainNetwork};
use crate::small_map::SmallMap;
use crate::{NodeId, Weight, count_step};

/// The limit on the steps of a conflict.
const MAX_STEPS: usize = 10_000;

impl<W: Weight> UncertainNetwork<W> {
    /// Returns the network's dispatchable form with all edges found, if it is dynamically
    /// controllable. The edges are the proof of controllability.
    ///
    /// # Errors
    /// The cycle that shows that it is not.
    pub fn dynamic(&self) -> Result<Dispatchable<W>, Conflict<W>> {
        let graph = self.search(true, true)?;
        Ok(Dispatchable::new(self.clone(), graph))
    }

    /// Returns the dispatchable form without redundant edges and waits: those between points whose
    /// order is fixed anyway.
    ///
    /// # Errors
    /// The cycle that shows that it is not dynamically controllable.
    pub fn executable(&self) -> Result<Dispatchable<W>, Conflict<W>> {
        let graph = self.search(true, false)?;
        Ok(Dispatchable::new(self.clone(), graph))
    }

    /// Returns the proof that the network is not dynamically controllable; `None` if it is
    /// controllable. Faster than [`dynamic`](Self::dynamic), because it keeps no edges for
    /// dispatching.
    pub fn conflict(&self) -> Option<Conflict<W>> {
        self.search(false, false).err()
    }

    /// Returns `true` if a strategy that depends only on past observations satisfies every
    /// requirement, whatever the world does.
    pub fn is_dynamically_controllable(&self) -> bool {
        self.search(false, false).is_ok()
    }

    /// Searches for a conflict. The graph contains all edges found if `is_full`, else redundant
    /// ones are left out.
    pub(super) fn search(&self, keeps_edges: bool, is_full: bool) -> Result<Graph<W>, Conflict<W>> {
        let mut graph = Graph::new(self);
        graph.is_full = is_full;
        let mut search = Search::new(self, &mut graph, keeps_edges);
        for node in self.requirements.nodes() {
            search.settle(node)?;
        }
        Ok(graph)
    }
}

/// The search state of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    New,
    InProgress,
    Done,
}

/// Search for a conflict. It adds the edges it finds to the graph.
pub(super) struct Search<'a, W> {
    links: &'a UncertainNetwork<W>,
    graph: &'a mut Graph<W>,
    pub(super) stage: Vec<Stage>,
    /// For each processed node, the nodes through which negative paths lead to it. The edges found
    /// for the node depend only on them, and on the edges that end at them.
    pub(super) regions: Vec<Vec<NodeId>>,
    /// Stack of negative nodes being processed; each one is needed by the previous one.
    frames: Vec<Frame<W>>,
    /// `true` if negative edges found are kept for dispatching.
    keeps_edges: bool,
}

/// Callback for cycles: receives the place where a cycle closes and its paths in order, and returns
/// whether the search continues.
type OnCycle<'a, W> = dyn FnMut(&Graph<W>, ClosedCycle, &[PathId]) -> ControlFlow<()> + 'a;

/// Negative node being processed.
struct Frame<W> {
    node: NodeId,
    /// The upper-case edges into it that are still to be followed.
    upper: Vec<EdgeId>,
    /// The upper-case edge being followed; `None` for the plain edges.
    label: Option<LinkId>,
    /// Plain edges that waits have turned into.
    plain: Vec<EdgeId>,
    /// `true` once the plain edges are being followed.
    is_plain_pass: bool,
    reached: SmallMap<NodeId, Reached<W>>,
    /// Edges that close a cycle at the node in this pass, other than that of the shortest one. The
    /// newest edges, which may contain the others, are processed first.
    others: BTreeSet<EdgeId>,
    region: Vec<NodeId>,
    queue: BinaryHeap<Reverse<(Extended<W>, NodeId)>>,
}

impl<W: Weight> Frame<W> {
    /// Returns the path from a node that has been reached.
    fn at(&self, node: NodeId) -> &Reached<W> {
        self.reached.get(node).expect("it has been reached")
    }

    fn distance(&self, node: NodeId) -> Extended<W> {
        self.at(node).distance.clone()
    }
}

/// Place where the paths of the current frames close a cycle.
#[derive(Clone, Copy)]
pub(super) enum ClosedCycle {
    /// At a node that is being processed, by the shortest path to it.
    At(NodeId),
    /// At the node of the last frame, by a longer path that begins with this edge.
    By(EdgeId),
}

/// Way from a node to the frame's node.
struct Reached<W> {
    distance: Extended<W>,
    /// Its first edge.
    edge: EdgeId,
    /// The path, once it is known to be the shortest.
    path: Option<PathId>,
}

impl<'a, W: Weight> Search<'a, W> {
    /// Creates a search without processed nodes.
    pub(super) fn new(
        links: &'a UncertainNetwork<W>,
        graph: &'a mut Graph<W>,
        keeps_edges: bool,
    ) -> Self {
        let count = links.requirements.node_count();
        Self {
            links,
            graph,
            stage: vec![Stage::New; count],
            regions: vec![Vec::new(); count],
            frames: Vec::new(),
            keeps_edges,
        }
    }

    /// Processes a node, and the nodes that have to be processed before it.
    pub(super) fn settle(&mut self, node: NodeId) -> Result<(), Conflict<W>> {
        self.push_frame(node);
        match self.run() {
            None => Ok(()),
            Some(closed) => Err(self.conflict(closed)),
        }
    }

    /// Processes a node, and the nodes that have to be processed before it, and continues after
    /// conflicts. `on_cycle` receives each conflict as paths, each beginning where the previous one
    /// ends, and returns whether the search continues. A path that has led to a conflict is not
    /// followed any further.
    pub(super) fn settle_all(
        &mut self,
        node: NodeId,
        on_cycle: &mut OnCycle<'_, W>,
    ) -> ControlFlow<()> {
        self.push_frame(node);
        while let Some(closed) = self.run() {
            let cycle = self.cycle(closed);
            on_cycle(self.graph, closed, &cycle)?;
        }
        ControlFlow::Continue(())
    }

    /// Processes all frames until a cycle closes, and returns its place. The next call continues
    /// without that cycle.
    fn run(&mut self) -> Option<ClosedCycle> {
        while let Some(frame) = self.frames.last_mut() {
            let Some(Reverse((distance, node))) = frame.queue.pop() else {
                if let Some(edge) = frame.others.pop_last() {
                    return Some(ClosedCycle::By(edge));
                }
                if !self.next_pass() {
                    let done = self.frames.pop().expect("the last frame is there");
                    self.stage[done.node.index()] = Stage::Done;
                    self.regions[done.node.index()] = done.region;
                }
                continue;
            };
            let reached = frame.reached.get_mut(node).expect("queued when reached");
            if reached.distance < distance || reached.path.is_some() {
                continue;
            }
            if !distance.is_negative() {
                self.record_edge(node);
                continue;
            }
            match self.stage[node.index()] {
                Stage::InProgress => return Some(ClosedCycle::At(node)),
                Stage::New => {
                    // This node is continued when that node has been processed.
                    frame.queue.push(Reverse((distance, node)));
                    self.push_frame(node);
                }
                Stage::Done => {
                    frame.region.push(node);
                    if self.record_edge(node) {
                        self.extend(node);
                    }
                }
            }
        }
        None
    }

    fn push_frame(&mut self, node: NodeId) {
        let index = node.index();
        if self.stage[index] != Stage::New {
            return;
        }
        let upper = self.graph.upper_into[index].clone();
        if upper.is_empty() && self.graph.negative_into[index].is_empty() {
            self.stage[index] = Stage::Done;
            return;
        }
        self.stage[index] = Stage::InProgress;
        self.frames.push(Frame {
            node,
            upper,
            label: None,
            plain: Vec::new(),
            is_plain_pass: false,
            reached: SmallMap::default(),
            others: BTreeSet::new(),
            region: Vec::new(),
            queue: BinaryHeap::new(),
        });
    }

    /// Starts the pass of the next upper-case edge of the last frame, or of the plain edges.
    /// Returns `false` if there is none.
    fn next_pass(&mut self) -> bool {
        let Some(frame) = self.frames.last_mut() else {
            return false;
        };
        if frame.is_plain_pass {
            return false;
        }
        frame.reached.clear();
        let first = if let Some(edge) = frame.upper.pop() {
            frame.label = match self.graph.edges[edge].kind {
                Kind::Upper(link) => Some(link),
                _ => None,
            };
            vec![edge]
        } else {
            frame.label = None;
            frame.is_plain_pass = true;
            let mut first = self.graph.negative_into[frame.node.index()].clone();
            first.append(&mut frame.plain);
            first
        };
        for edge in first {
            let distance = self.graph.edges[edge].bound.clone();
            self.reach(edge, distance);
        }
        true
    }

    /// Records a path that begins with that edge.
    fn reach(&mut self, edge: EdgeId, distance: Extended<W>) {
        let from = self.graph.edges[edge].from;
        let Some(frame) = self.frames.last_mut() else {
            return;
        };
        if let Some(known) = frame.reached.get(from) {
            let (longer, by) = if known.distance <= distance {
                (&distance, edge)
            } else {
                (&known.distance, known.edge)
            };
            if from == frame.node && longer.is_negative() {
                frame.others.insert(by);
            }
            if known.distance <= distance {
                return;
            }
        }
        frame.queue.push(Reverse((distance.clone(), from)));
        let reached = Reached {
            distance,
            edge,
            path: None,
        };
        frame.reached.insert(from, reached);
    }

    /// Records the shortest path from a node to the last frame's node as an edge. Returns `false`
    /// if the path need not be extended in its current form: a wait that is redundant, or that has
    /// become a plain edge.
    fn record_edge(&mut self, node: NodeId) -> bool {
        let way = self.shortest_path(node);
        let links = self.links;
        let Some(frame) = self.frames.last_mut() else {
            return false;
        };
        let distance = frame.distance(node);
        let is_one_edge = self.graph.paths[way].rest().is_none();
        let edge = |kind| Edge {
            from: node,
            to: frame.node,
            bound: distance.clone(),
            kind,
            origin: Origin::Path(way),
        };
        match frame.label {
            // The node comes after the link's end anyway.
            Some(link) if self.graph.is_after(node, links.link(link).end) => false,
            // The link cannot have ended before, so the wait is a plain edge.
            Some(link) if distance >= Extended::from(links.link(link).lower.clone()).negated() => {
                if node == frame.node {
                    return false;
                }
                let id = self.graph.edges.len();
                let edge = edge(Kind::Plain);
                if edge.bound.is_negative() {
                    // It is followed with the other plain edges.
                    self.graph.edges.push(edge);
                    frame.plain.push(id);
                } else {
                    self.add(edge);
                }
                false
            }
            Some(link) => {
                if !is_one_edge && self.keeps_edges {
                    let edge = edge(Kind::Upper(link));
                    self.graph.edges.push(edge);
                }
                true
            }
            None if is_one_edge || node == frame.node => true,
            None => {
                let edge = edge(Kind::Plain);
                if !edge.bound.is_negative() {
                    self.add(edge);
                } else if self.keeps_edges {
                    self.graph.edges.push(edge);
                }
                true
            }
        }
    }

    /// Adds an edge that is not negative, unless it is redundant.
    fn add(&mut self, edge: Edge<W>) {
        if !self.graph.is_after(edge.from, edge.to) {
            self.graph.add(edge);
        }
    }

    /// Returns the shortest path from a node to the last frame's node, and fixes it.
    fn shortest_path(&mut self, node: NodeId) -> PathId {
        let way = self.path_to(self.frames.len() - 1, node);
        let frame = self.frames.last_mut();
        if let Some(reached) = frame.and_then(|frame| frame.reached.get_mut(node)) {
            reached.path = Some(way);
        }
        way
    }

    /// Returns the shortest known path from a node to that frame's node.
    fn path_to(&mut self, frame: usize, node: NodeId) -> PathId {
        let edge = self.frames[frame].at(node).edge;
        self.path_by_edge(frame, edge)
    }

    /// Returns the shortest known path to that frame's node that begins with this edge.
    fn path_by_edge(&mut self, frame: usize, edge: EdgeId) -> PathId {
        let frame = &self.frames[frame];
        let next = self.graph.edges[edge].to;
        let rest = match frame.reached.get(next) {
            Some(reached) if next != frame.node => reached.path,
            _ => None,
        };
        self.graph.paths.push(Path::new(edge, rest));
        self.graph.paths.len() - 1
    }

    /// Follows the edges that end at a node.
    fn extend(&mut self, node: NodeId) {
        let Some(frame) = self.frames.last() else {
            return;
        };
        let label = frame.label;
        let distance = frame.distance(node);
        for index in 0..self.graph.positive_into[node.index()].len() {
            let id = self.graph.positive_into[node.index()][index];
            let edge = &self.graph.edges[id];
            if label.is_some_and(|link| edge.kind == Kind::Lower(link)) {
                continue;
            }
            let through = distance.plus(&edge.bound);
            self.reach(id, through);
        }
    }

    /// Returns the cycle that closes there: the paths from that place to the last frame's node, and
    /// from each frame's node to the previous one, back to that place.
    fn cycle(&mut self, closed: ClosedCycle) -> Vec<PathId> {
        let node = match closed {
            ClosedCycle::At(node) => node,
            ClosedCycle::By(edge) => {
                return vec![self.path_by_edge(self.frames.len() - 1, edge)];
            }
        };
        let first = self.frame_index(node);
        let mut from = node;
        let ways = (first..self.frames.len()).rev().map(|index| {
            let way = self.path_to(index, from);
            from = self.frames[index].node;
            way
        });
        ways.collect()
    }

    fn frame_index(&self, node: NodeId) -> usize {
        let first = self.frames.iter().position(|frame| frame.node == node);
        first.expect("an active node has a frame")
    }

    /// Returns the conflict that closes there, step by step.
    fn conflict(&mut self, closed: ClosedCycle) -> Conflict<W> {
        let mut total = Extended::zero();
        let mut steps = Vec::new();
        let mut is_whole = true;
        for way in self.cycle(closed) {
            let mut edges = Vec::new();
            let mut next = Some(way);
            while let Some(way) = next {
                count_step();
                let edge = self.graph.paths[way].edge();
                total = total.plus(&self.graph.edges[edge].bound);
                is_whole &= self.graph.expand(edge, MAX_STEPS, &mut edges);
                next = self.graph.paths[way].rest();
            }
            for edge in edges {
                if steps.len() < MAX_STEPS {
                    steps.push(self.graph.step(edge));
                } else {
                    is_whole = false;
                }
            }
        }
        Conflict {
            steps,
            is_whole,
            total,
        }
    }
}
