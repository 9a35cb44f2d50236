//! Windows that are kept up to date while one time after another becomes known.

mod loosen;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use elbowroom_num::Rational;

use crate::direction::Direction;
use crate::paths::ShortestPaths;
use crate::{
    ConsistentNetwork, ConstraintId, Network, NodeId, Schedule, Weight, Window, spend_step,
};

/// A network, and the [`Window`] of each of its nodes seen from an origin, while limits on single
/// nodes are added: what executing a plan does to its network.
///
/// Invariant: the windows are exact. Every time in a node's window occurs in some schedule that
/// satisfies all constraints and limits, so checking one node is checking the whole network.
///
/// A limit costs time in proportion to the windows it moves (Dijkstra's algorithm with the
/// schedule of the [`ConsistentNetwork`] as potential; cf. Cesta & Oddi, TIME 1996).
#[derive(Clone, Debug)]
pub struct MovingWindows<W = Rational> {
    network: Network<W>,
    /// A schedule without the limits: what makes all edges non-negative.
    potential: Schedule<W>,
    origin: NodeId,
    windows: Vec<Window<W>>,
    /// For each node, what its earliest and its latest time come from.
    sources: Vec<[Source; 2]>,
    /// For each node, the most that limits on itself say of its earliest and its latest time.
    limits: Vec<[Option<W>; 2]>,
    /// For each constraint, whether it demands nothing any more.
    is_lifted: Vec<bool>,
    queue: BinaryHeap<Reverse<(W, NodeId)>>,
}

/// The origin of one end of a time window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// From nothing: it is infinite, or the node is the origin.
    Nothing,
    /// From a limit on this very node.
    Limit,
    /// Through this constraint, from the node at its other end.
    Constraint(ConstraintId),
}

/// One end of a time window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WindowEnd {
    /// Earliest time of the node.
    Earliest,
    /// Latest time of the node.
    Latest,
}

/// Explanation of one end of a window: the path of constraints that implies it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grounds {
    /// The node where it begins: one with a limit of its own, or the origin.
    pub root: NodeId,
    /// The constraints that carry it from there, beginning at `root`.
    pub constraints: Vec<ConstraintId>,
}

/// A limit contradicts the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutOfWindow<W = Rational> {
    /// The node that the limit was for.
    pub node: NodeId,
    /// The end of its window that is in the way.
    pub end: WindowEnd,
    /// By how much the limit misses it; positive.
    pub by: W,
}

impl<W: Weight> MovingWindows<W> {
    /// The windows of a network before anything is known.
    pub fn new(network: ConsistentNetwork<W>, origin: NodeId) -> Self {
        let (after, before) = (
            network.shortest_paths_from(origin),
            network.shortest_paths_to(origin),
        );
        let source = |paths: &ShortestPaths<W>, node| match paths.step(node) {
            Some(id) => Source::Constraint(id),
            None => Source::Nothing,
        };
        let nodes = || network.network().nodes();
        let window = |node| Window {
            earliest: before.distance(node).map(W::negated),
            latest: after.distance(node).cloned(),
        };
        Self {
            windows: nodes().map(window).collect(),
            sources: nodes()
                .map(|node| [source(&before, node), source(&after, node)])
                .collect(),
            limits: nodes().map(|_| [None, None]).collect(),
            is_lifted: vec![false; network.network().constraints().len()],
            origin,
            potential: network.schedule().clone(),
            network: network.into_network(),
            queue: BinaryHeap::new(),
        }
    }

    /// The constraints, without the limits. Those that were lifted are still among them.
    pub fn network(&self) -> &Network<W> {
        &self.network
    }

    /// The node that times are relative to.
    pub fn origin(&self) -> NodeId {
        self.origin
    }

    /// The time at which the node may happen, relative to the origin.
    pub fn window(&self, node: NodeId) -> &Window<W> {
        &self.windows[node.index()]
    }

    /// `node` happens at `time`.
    ///
    /// # Errors
    /// When it cannot; then the windows stay as they were.
    pub fn fix(&mut self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        self.check_earliest(node, time)?;
        self.not_before(node, time)?;
        self.not_after(node, time)
    }

    /// `node` happens at `time` or later.
    ///
    /// # Errors
    /// When it cannot; then the windows stay as they were.
    pub fn not_before(&mut self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        let window = &self.windows[node.index()];
        if let Some(latest) = window.latest.as_ref().filter(|latest| time > *latest) {
            return Err(OutOfWindow {
                node,
                end: WindowEnd::Latest,
                by: time.minus(latest),
            });
        }
        let is_new = window.earliest.as_ref().is_none_or(|old| time > old);
        let limit = &mut self.limits[node.index()][WindowEnd::Earliest as usize];
        if limit.as_ref().is_none_or(|old| time > old) {
            *limit = Some(time.clone());
        }
        if is_new {
            self.spread(Direction::ToRoot, node, time.negated());
        }
        Ok(())
    }

    /// `node` happens at `time` or earlier.
    ///
    /// # Errors
    /// When it cannot; then the windows stay as they were.
    pub fn not_after(&mut self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        self.check_earliest(node, time)?;
        let limit = &mut self.limits[node.index()][WindowEnd::Latest as usize];
        if limit.as_ref().is_none_or(|old| time < old) {
            *limit = Some(time.clone());
        }
        let window = &self.windows[node.index()];
        if window.latest.as_ref().is_none_or(|old| time < old) {
            self.spread(Direction::FromRoot, node, time.clone());
        }
        Ok(())
    }

    /// Returns the explanation of one end of a node's window; `None` if that end is infinite.
    pub fn grounds(&self, node: NodeId, end: WindowEnd) -> Option<Grounds> {
        let window = self.window(node);
        match end {
            WindowEnd::Earliest => window.earliest.as_ref()?,
            WindowEnd::Latest => window.latest.as_ref()?,
        };
        let mut constraints = Vec::new();
        let mut root = node;
        while let Source::Constraint(id) = self.sources[root.index()][end as usize] {
            constraints.push(id);
            let constraint = self.network.constraint(id);
            root = match end {
                WindowEnd::Earliest => constraint.to,
                WindowEnd::Latest => constraint.from,
            };
        }
        constraints.reverse();
        Some(Grounds { root, constraints })
    }

    fn check_earliest(&self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        let earliest = self.windows[node.index()].earliest.as_ref();
        match earliest.filter(|earliest| time < *earliest) {
            Some(earliest) => Err(OutOfWindow {
                node,
                end: WindowEnd::Earliest,
                by: earliest.minus(time),
            }),
            None => Ok(()),
        }
    }

    /// Shortens the distance of one node to `distance`, and with it those of others.
    fn spread(&mut self, direction: Direction, node: NodeId, distance: W) {
        self.shorten(direction, node, distance, Source::Limit);
        self.settle(direction);
    }

    /// Hands on the distances of all that are queued.
    fn settle(&mut self, direction: Direction) {
        while let Some(Reverse((key, node))) = self.queue.pop() {
            spend_step();
            let distance = self
                .distance(direction, node)
                .expect("queued with a distance");
            if direction.key(&distance, node, &self.potential) < key {
                continue; // It has been shortened again since.
            }
            let mut next = self.network.first(node, direction);
            while let Some(id) = next {
                next = self.network.after(id, direction);
                if self.is_lifted(id) {
                    continue;
                }
                let constraint = self.network.constraint(id);
                let far = direction.far_end(constraint);
                let through = distance.plus(&constraint.bound);
                if far != self.origin
                    && self
                        .distance(direction, far)
                        .is_none_or(|old| through < old)
                {
                    self.shorten(direction, far, through, Source::Constraint(id));
                }
            }
        }
    }

    fn is_lifted(&self, id: ConstraintId) -> bool {
        self.is_lifted[id.index()]
    }

    /// The latest time, or the earliest one negated: the length of a shortest path.
    fn distance(&self, direction: Direction, node: NodeId) -> Option<W> {
        let window = &self.windows[node.index()];
        match direction {
            Direction::FromRoot => window.latest.clone(),
            Direction::ToRoot => window.earliest.as_ref().map(W::negated),
        }
    }

    fn shorten(&mut self, direction: Direction, node: NodeId, distance: W, source: Source) {
        let key = direction.key(&distance, node, &self.potential);
        self.queue.push(Reverse((key, node)));
        let window = &mut self.windows[node.index()];
        let sources = &mut self.sources[node.index()];
        match direction {
            Direction::FromRoot => {
                window.latest = Some(distance);
                sources[WindowEnd::Latest as usize] = source;
            }
            Direction::ToRoot => {
                window.earliest = Some(distance.negated());
                sources[WindowEnd::Earliest as usize] = source;
            }
        }
    }
}
