//! Temporal network of the happenings whose times are not settled yet.
//!
//! A happening is settled when no running action can delay it any more. Its earliest time is then
//! the best for all later happenings, and it leaves the network. The remaining network is small,
//! and together with the annotations it contains all relevant information about the past.
//!
//! All constraints are of the form `to >= from + distance`. The network keeps the earliest time of
//! each node, and is consistent if no node is later than its latest time and there is no positive
//! cycle (Cesta & Oddi, "Gaining efficiency and flexibility in the simple temporal problem", TIME
//! 1996, for the incremental test).
//!
//! In addition, nodes may have to be in [windows](super::windows). Lower bounds are propagated
//! along the constraints first. A node outside of its windows then moves to the next one, and so on
//! until no node moves.

mod windows;

use std::sync::Arc;

use super::time::{NEVER, Ticks};
use super::windows::Windows;
pub(crate) use windows::Within;

/// A happening of the network.
pub(crate) type NodeId = u16;

/// No node: the happening is settled.
pub(crate) const SETTLED: NodeId = NodeId::MAX;

/// Simple temporal network with windows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Network {
    nodes: Vec<Node>,
    /// The constraints that are not in the matrix.
    edges: Vec<Edge>,
    /// Distances between all nodes at the time of the last [`project`](Network::project), row by
    /// row. Otherwise empty.
    matrix: Vec<Ticks>,
    /// Number of rows of the matrix.
    closed: usize,
    /// Annotations that unsettled happenings have set.
    pub(crate) marks: Vec<(u32, NodeId)>,
    /// The windows that `within` refers to; `None` if the problem has none.
    windows: Option<Arc<Windows>>,
    within: Vec<Within>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Lower bound of the node itself.
    floor: Ticks,
    earliest: Ticks,
    latest: Ticks,
}

/// `to >= from + distance`.
#[derive(Clone, Copy, Debug)]
struct Edge {
    from: NodeId,
    to: NodeId,
    distance: Ticks,
}

/// The constraints contradict each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Inconsistent;

impl Network {
    /// Returns an empty network with these windows.
    pub(crate) fn with_windows(windows: Option<Arc<Windows>>) -> Self {
        Self {
            windows,
            ..Self::default()
        }
    }

    /// Returns an empty network with the same windows.
    pub(crate) fn emptied(&self) -> Self {
        Self::with_windows(self.windows.clone())
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    pub(crate) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    pub(crate) fn earliest(&self, node: NodeId) -> Ticks {
        self.nodes[node as usize].earliest
    }

    /// Returns the earliest time at which all of its happenings can be over.
    pub(crate) fn earliest_end(&self) -> Ticks {
        let times = self.nodes.iter().map(|node| node.earliest);
        times.max().unwrap_or(-NEVER)
    }

    /// Adds a node that follows others at given distances.
    pub(crate) fn add_node(
        &mut self,
        earliest: Ticks,
        latest: Ticks,
        after: &[(NodeId, Ticks)],
    ) -> Result<NodeId, Inconsistent> {
        // Plans with sixty thousand unsettled happenings are out of reach anyway.
        let node = NodeId::try_from(self.nodes.len()).map_err(|_| Inconsistent)?;
        if node == SETTLED {
            return Err(Inconsistent);
        }
        let floor = earliest;
        let mut time = floor;
        for &(from, distance) in after {
            time = time.max(self.earliest(from) + distance);
            self.edges.push(Edge {
                from,
                to: node,
                distance,
            });
        }
        if time > latest {
            return Err(Inconsistent);
        }
        self.nodes.push(Node {
            floor,
            earliest: time,
            latest,
        });
        Ok(node)
    }

    /// Adds `to >= from + distance` to a consistent network.
    pub(crate) fn add_edge(
        &mut self,
        from: NodeId,
        to: NodeId,
        distance: Ticks,
    ) -> Result<(), Inconsistent> {
        self.edges.push(Edge { from, to, distance });
        let time = self.earliest(from) + distance;
        self.push(to, time, from)
    }

    /// Moves a node to `time` or later, and propagates the change. If the edges alone would move
    /// `origin`, the new edge from there has closed a positive cycle.
    fn push(&mut self, node: NodeId, time: Ticks, origin: NodeId) -> Result<(), Inconsistent> {
        self.follow_edges(node, time, origin)?;
        self.enter_windows()
    }

    /// Returns for each node whether some node of `from` can delay it.
    pub(crate) fn reach(&self, from: impl Iterator<Item = NodeId>) -> Vec<bool> {
        let mut waiting: Vec<NodeId> = from.collect();
        let mut is_reached = vec![false; self.nodes.len()];
        while let Some(node) = waiting.pop() {
            if std::mem::replace(&mut is_reached[node as usize], true) {
                continue;
            }
            let next = self.edges.iter().filter(|edge| edge.from == node);
            waiting.extend(next.map(|edge| edge.to));
            if (node as usize) < self.closed {
                let row = (0..).zip(self.row(node));
                waiting.extend(row.filter(|(_, d)| **d > -NEVER).map(|(to, _)| to));
            }
            // An end that moves to a later window delays its start.
            let windows = self.within.iter().filter(|within| within.last == node);
            waiting.extend(windows.map(|within| within.first));
        }
        is_reached
    }

    /// Propagates the change along the edges only, without the windows.
    ///
    /// Edges are in the order of happenings, so that few rounds over all of them are needed. A depth-first
    /// propagation would visit a node once for each path to it.
    fn follow_edges(
        &mut self,
        node: NodeId,
        time: Ticks,
        origin: NodeId,
    ) -> Result<(), Inconsistent> {
        let mut raised = Vec::new();
        let mut has_changed = self.raise(node, time, origin, &mut raised)?;
        while has_changed {
            has_changed = false;
            for place in 0..self.edges.len() {
                let Edge { from, to, distance } = self.edges[place];
                let time = self.earliest(from) + distance;
                has_changed |= self.raise(to, time, origin, &mut raised)?;
            }
            while let Some(from) = raised.pop() {
                for to in 0..self.closed {
                    let distance = self.matrix[from as usize * self.closed + to];
                    if distance > -NEVER {
                        let time = self.earliest(from) + distance;
                        let to = NodeId::try_from(to).unwrap_or(SETTLED);
                        has_changed |= self.raise(to, time, origin, &mut raised)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Raises the earliest time of one node, and records it in `raised` if it has a row in the matrix. Returns
    /// `true` if the time has changed.
    fn raise(
        &mut self,
        node: NodeId,
        time: Ticks,
        origin: NodeId,
        raised: &mut Vec<NodeId>,
    ) -> Result<bool, Inconsistent> {
        let place = &mut self.nodes[node as usize];
        if time <= place.earliest {
            return Ok(false);
        }
        if time > place.latest || node == origin {
            return Err(Inconsistent);
        }
        place.earliest = time;
        if (node as usize) < self.closed {
            raised.push(node);
        }
        Ok(true)
    }

    /// Raises the lower bound of a node to `time`.
    pub(crate) fn raise_earliest(&mut self, node: NodeId, time: Ticks) -> Result<(), Inconsistent> {
        let floor = &mut self.nodes[node as usize].floor;
        *floor = (*floor).max(time);
        self.push(node, time, SETTLED)
    }

    /// Lowers the upper bound of a node to `time`.
    pub(crate) fn lower_latest(&mut self, node: NodeId, time: Ticks) -> Result<(), Inconsistent> {
        let place = &mut self.nodes[node as usize];
        place.latest = place.latest.min(time);
        if place.earliest > place.latest {
            return Err(Inconsistent);
        }
        Ok(())
    }

    /// Records that a node has set an annotation. Older nodes that are known to precede it are
    /// dropped for that annotation.
    pub(crate) fn mark(&mut self, annotation: u32, node: NodeId) {
        let older = self.marks.iter().filter(|mark| mark.0 == annotation);
        let older: Vec<NodeId> = older.map(|mark| mark.1).collect();
        if !older.is_empty() {
            // The edges to a new node are the last ones.
            let newest = self.edges.iter().rev().take_while(|edge| edge.to == node);
            for edge in newest.filter(|edge| edge.distance >= 0 && older.contains(&edge.from)) {
                let known = (annotation, edge.from);
                if let Some(place) = self.marks.iter().position(|mark| *mark == known) {
                    self.marks.swap_remove(place);
                }
            }
        }
        self.marks.push((annotation, node));
    }

    /// Settles all happenings at their earliest times and empties the network.
    pub(crate) fn settle_all(&mut self, settle: &mut dyn FnMut(u32, Ticks)) {
        for &(annotation, node) in &self.marks {
            settle(annotation, self.nodes[node as usize].earliest);
        }
        *self = Self::with_windows(self.windows.take());
    }

    /// Keeps only the nodes that the nodes `open` can still delay. Passes the annotations and times
    /// of the settled nodes to `settle`, and returns the new names of the nodes.
    pub(crate) fn settle(
        &mut self,
        open: impl Iterator<Item = NodeId>,
        settle: &mut dyn FnMut(u32, Ticks),
    ) -> Vec<NodeId> {
        debug_assert_eq!(self.closed, 0, "a matrix is projected");
        let mut names = vec![SETTLED; self.nodes.len()];
        self.forget_last_windows();
        let is_kept = self.reach(open);
        let kept = names.iter_mut().zip(&is_kept).filter(|(_, kept)| **kept);
        for ((name, _), count) in kept.zip(0..) {
            *name = count;
        }
        let nodes = &self.nodes;
        self.marks.retain_mut(|(annotation, node)| {
            if !is_kept[*node as usize] {
                settle(*annotation, nodes[*node as usize].earliest);
                return false;
            }
            *node = names[*node as usize];
            true
        });
        // No kept node can delay a settled one, so an edge with a kept source is kept.
        self.edges.retain_mut(|edge| {
            let is_kept = is_kept[edge.from as usize];
            if is_kept {
                edge.from = names[edge.from as usize];
                edge.to = names[edge.to as usize];
            }
            is_kept
        });
        self.rename_within(&names);
        let mut position = 0;
        self.nodes.retain(|_| {
            position += 1;
            is_kept[position - 1]
        });
        names
    }

    /// Returns the distances from a node to those in the matrix.
    fn row(&self, node: NodeId) -> &[Ticks] {
        let begin = node as usize * self.closed;
        &self.matrix[begin..begin + self.closed]
    }

    /// Keeps only some nodes, with all implied distances among them: the possible times of these
    /// nodes stay the same. Returns the new names of the nodes. No other node may be marked, or be
    /// pushed to another window.
    pub(crate) fn project(&mut self, kept: &[NodeId]) -> Vec<NodeId> {
        let all = self.all_distances();
        let count = self.nodes.len();
        let mut names = vec![SETTLED; count];
        for (&node, name) in kept.iter().zip(0..) {
            names[node as usize] = name;
        }
        let mut nodes = Vec::with_capacity(kept.len());
        self.matrix.clear();
        for &from in kept {
            let row = &all[from as usize * count..][..count];
            let time = self.earliest(from);
            nodes.push(Node {
                floor: time,
                earliest: time,
                latest: self.latest_given(row),
            });
            self.matrix.extend(kept.iter().map(|&to| row[to as usize]));
        }
        self.nodes = nodes;
        self.closed = kept.len();
        self.edges.clear();
        for (_, node) in &mut self.marks {
            *node = names[*node as usize];
        }
        self.rename_within(&names);
        names
    }

    /// Returns the distances between all nodes, row by row, from the matrix and the edges.
    fn all_distances(&self) -> Vec<Ticks> {
        let count = self.nodes.len();
        let mut all = vec![-NEVER; count * count];
        for from in 0..self.closed {
            all[from * count..][..self.closed]
                .copy_from_slice(&self.matrix[from * self.closed..][..self.closed]);
        }
        for node in 0..count {
            all[node * count + node] = 0;
        }
        let raise = |place: &mut Ticks, first: Ticks, second: Ticks| {
            if first > -NEVER && second > -NEVER {
                *place = (*place).max(first + second);
            }
        };
        for new in self.closed..count {
            let edges = self.edges.iter().map(|edge| {
                let (from, to) = (edge.from as usize, edge.to as usize);
                (from, to, edge.distance)
            });
            for (from, to, distance) in edges {
                for other in 0..new {
                    if to == new && from < new {
                        let reached = all[other * count + from];
                        raise(&mut all[other * count + new], reached, distance);
                    }
                    if from == new && to < new {
                        let reached = all[to * count + other];
                        raise(&mut all[new * count + other], distance, reached);
                    }
                }
            }
            for from in 0..new {
                let to_new = all[from * count + new];
                if to_new == -NEVER {
                    continue;
                }
                for to in 0..new {
                    let from_new = all[new * count + to];
                    raise(&mut all[from * count + to], to_new, from_new);
                }
            }
        }
        // Edges between nodes of the matrix.
        let is_old = |edge: &&Edge| (edge.from.max(edge.to) as usize) < self.closed;
        for edge in self.edges.iter().filter(is_old) {
            for from in 0..count {
                let reached = all[from * count + edge.from as usize];
                if reached == -NEVER {
                    continue;
                }
                for to in 0..count {
                    let rest = all[edge.to as usize * count + to];
                    raise(&mut all[from * count + to], reached + edge.distance, rest);
                }
            }
        }
        all
    }

    /// Returns for each node its minimum distance after `origin`, or `-NEVER` if there is none.
    pub(crate) fn distances_from(&self, origin: NodeId) -> Vec<Ticks> {
        if self.is_closed() && self.closed > 0 {
            return self.row(origin).to_vec();
        }
        debug_assert_eq!(self.closed, 0, "a matrix is asked when it is complete");
        let mut distances = vec![-NEVER; self.nodes.len()];
        distances[origin as usize] = 0;
        // Edges are in the order of happenings, so that few rounds are needed.
        let mut changed = true;
        while changed {
            changed = false;
            for edge in &self.edges {
                let reached = distances[edge.from as usize];
                let distance = reached + edge.distance;
                if reached > -NEVER && distance > distances[edge.to as usize] {
                    distances[edge.to as usize] = distance;
                    changed = true;
                }
            }
        }
        distances
    }

    /// Returns the minimum distance of one node after another if all distances are known, or
    /// `-NEVER` if there is none.
    pub(crate) fn distance(&self, from: NodeId, to: NodeId) -> Ticks {
        self.matrix[from as usize * self.closed + to as usize]
    }

    /// Returns `true` if all distances are known.
    pub(crate) fn is_closed(&self) -> bool {
        self.edges.is_empty() && self.closed == self.nodes.len()
    }

    /// Returns the latest time of a node at which none of the nodes it delays is too late.
    pub(crate) fn latest_given(&self, distances: &[Ticks]) -> Ticks {
        let nodes = self.nodes.iter().zip(distances);
        nodes
            .filter(|(node, distance)| node.latest < NEVER && **distance > -NEVER)
            .map(|(node, distance)| node.latest - distance)
            .min()
            .unwrap_or(NEVER)
    }

    /// Returns all constraints between nodes, as `(from, to, distance)`.
    pub(crate) fn edges(&self) -> impl Iterator<Item = (NodeId, NodeId, Ticks)> + '_ {
        self.edges
            .iter()
            .map(|edge| (edge.from, edge.to, edge.distance))
    }

    /// Returns the bounds of each node itself: its lower bound, independent of other nodes, and its
    /// latest time.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = (Ticks, Ticks)> + '_ {
        self.nodes.iter().map(|node| (node.floor, node.latest))
    }

    /// Frees memory reserved for growth, which a stored network does not need.
    pub(crate) fn shrink(&mut self) {
        self.nodes.shrink_to_fit();
        self.edges.shrink_to_fit();
        self.marks.shrink_to_fit();
    }

    /// Returns an estimate of the memory, in bytes.
    pub(crate) fn size(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
            + self.edges.capacity() * size_of::<Edge>()
            + self.matrix.capacity() * size_of::<Ticks>()
            + self.marks.capacity() * size_of::<(u32, NodeId)>()
            + self.within.capacity() * size_of::<Within>()
    }
}

#[cfg(test)]
mod tests;
