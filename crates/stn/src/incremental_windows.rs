//! Windows that are updated while times become known.

mod loosen;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use elbowroom_num::Rational;

use crate::direction::Direction;
use crate::paths::ShortestPaths;
use crate::{
    ConsistentNetwork, ConstraintId, Network, NodeId, Schedule, Weight, Window, count_step,
};

/// Network with the [`Window`] of each node relative to an origin, updated while limits on single
/// nodes are added, as during the execution of a plan.
///
/// Invariant: the windows are exact. Every time in a node's window occurs in some schedule that
/// satisfies all constraints and limits, so it is enough to check one node.
///
/// A limit costs time in proportion to the windows it moves (Dijkstra's algorithm with the schedule
/// of the [`ConsistentNetwork`] as potential; cf. Cesta & Oddi, TIME 1996).
#[derive(Clone, Debug)]
pub struct IncrementalWindows<W = Rational> {
    network: Network<W>,
    /// Schedule without the limits, which makes all edges non-negative.
    potential: Schedule<W>,
    origin: NodeId,
    windows: Vec<Window<W>>,
    /// For each node, the origins of its earliest and its latest time.
    sources: Vec<[Source; 2]>,
    /// For each node, the tightest limits on its own earliest and latest time.
    limits: Vec<[Option<W>; 2]>,
    /// For each constraint, `true` if it has been lifted.
    is_lifted: Vec<bool>,
    queue: BinaryHeap<Reverse<(W, NodeId)>>,
}

/// The origin of one end of a time window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// None: the end is infinite, or the node is the origin.
    Nothing,
    /// A limit on the node itself.
    Limit,
    /// This constraint, from the node at its other end.
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
    /// The node where the path begins: one with a limit of its own, or the origin.
    pub root: NodeId,
    /// The constraints of the path, beginning at `root`.
    pub constraints: Vec<ConstraintId>,
}

/// Error for a limit that contradicts the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutOfWindow<W = Rational> {
    /// The node that the limit was for.
    pub node: NodeId,
    /// The violated end of its window.
    pub end: WindowEnd,
    /// Amount of the violation; positive.
    pub amount: W,
}

impl<W: Weight> IncrementalWindows<W> {
    /// Computes the windows of a network without limits.
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

    /// Returns the constraints, without the limits. Lifted constraints are included.
    pub fn network(&self) -> &Network<W> {
        &self.network
    }

    /// Returns the node that times are relative to.
    pub fn origin(&self) -> NodeId {
        self.origin
    }

    /// Returns the window of the node, relative to the origin.
    pub fn window(&self, node: NodeId) -> &Window<W> {
        &self.windows[node.index()]
    }

    /// Adds the limit that `node` happens at `time`.
    ///
    /// # Errors
    /// If that is impossible; then the windows stay as they were.
    pub fn fix(&mut self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        self.check_earliest(node, time)?;
        self.not_before(node, time)?;
        self.not_after(node, time)
    }

    /// Adds the limit that `node` happens at `time` or later.
    ///
    /// # Errors
    /// If that is impossible; then the windows stay as they were.
    pub fn not_before(&mut self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        let window = &self.windows[node.index()];
        if let Some(latest) = window.latest.as_ref().filter(|latest| time > *latest) {
            return Err(OutOfWindow {
                node,
                end: WindowEnd::Latest,
                amount: time.minus(latest),
            });
        }
        let is_new = window.earliest.as_ref().is_none_or(|old| time > old);
        let limit = &mut self.limits[node.index()][WindowEnd::Earliest as usize];
        if limit.as_ref().is_none_or(|old| time > old) {
            *limit = Some(time.clone());
        }
        if is_new {
            self.propagate_from(Direction::ToRoot, node, time.negated());
        }
        Ok(())
    }

    /// Adds the limit that `node` happens at `time` or earlier.
    ///
    /// # Errors
    /// If that is impossible; then the windows stay as they were.
    pub fn not_after(&mut self, node: NodeId, time: &W) -> Result<(), OutOfWindow<W>> {
        self.check_earliest(node, time)?;
        let limit = &mut self.limits[node.index()][WindowEnd::Latest as usize];
        if limit.as_ref().is_none_or(|old| time < old) {
            *limit = Some(time.clone());
        }
        let window = &self.windows[node.index()];
        if window.latest.as_ref().is_none_or(|old| time < old) {
            self.propagate_from(Direction::FromRoot, node, time.clone());
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
                amount: earliest.minus(time),
            }),
            None => Ok(()),
        }
    }

    /// Shortens the distance of one node to `distance`, and propagates that to others.
    fn propagate_from(&mut self, direction: Direction, node: NodeId, distance: W) {
        self.shorten(direction, node, distance, Source::Limit);
        self.propagate(direction);
    }

    /// Propagates the distances of all queued nodes.
    fn propagate(&mut self, direction: Direction) {
        while let Some(Reverse((key, node))) = self.queue.pop() {
            count_step();
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

    /// Returns the latest time, or the earliest one negated: the length of a shortest path.
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
