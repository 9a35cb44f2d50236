//! The temporal network of those happenings whose times are not settled yet.
//!
//! A happening is settled when no action under way could still push it to a later time: then the
//! earliest time it can have is the best for everything that follows, and it leaves the network.
//! What stays is small, and is all that matters of the past besides the annotations.
//!
//! All constraints are of the form `to >= from + distance`. The network keeps the earliest time of
//! each node, and is consistent if no node is later than its latest time and no cycle pushes
//! itself (Cesta & Oddi, "Gaining efficiency and flexibility in the simple temporal problem",
//! TIME 1996, for the incremental test).
//!
//! Beside these, nodes may have to lie in [windows](super::windows). Lower bounds are propagated
//! along the constraints first. A node that lies outside of its windows then moves to the next one,
//! and so on until nothing moves.

mod windows;

use std::sync::Arc;

use super::time::{NEVER, Ticks};
use super::windows::Windows;
pub(crate) use windows::Within;

/// A happening of the network.
pub(crate) type NodeId = u16;

/// No node: the happening is settled.
pub(crate) const SETTLED: NodeId = NodeId::MAX;

/// See the module.
#[derive(Clone, Debug, Default)]
pub(crate) struct Network {
    nodes: Vec<Node>,
    /// The constraints that are not in the matrix.
    edges: Vec<Edge>,
    /// All distances, row by row, among the nodes that there were when it was made; see
    /// [`project`](Network::project). Otherwise empty.
    matrix: Vec<Ticks>,
    /// How many rows the matrix has.
    closed: usize,
    /// Annotations that unsettled happenings have set.
    pub(crate) marks: Vec<(u32, NodeId)>,
    /// The windows that `within` refers to; `None` if the problem has none.
    windows: Option<Arc<Windows>>,
    within: Vec<Within>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// A lower bound that holds whatever else happens.
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
    /// An empty network with these windows.
    pub(crate) fn with_windows(windows: Option<Arc<Windows>>) -> Self {
        Self {
            windows,
            ..Self::default()
        }
    }

    /// An empty network with the same windows.
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

    /// The earliest time at which all of its happenings can be over.
    pub(crate) fn earliest_end(&self) -> Ticks {
        let times = self.nodes.iter().map(|node| node.earliest);
        times.max().unwrap_or(-NEVER)
    }

    /// Adds a node that comes at given distances after others.
    pub(crate) fn add_node(
        &mut self,
        earliest: Ticks,
        latest: Ticks,
        after: &[(NodeId, Ticks)],
    ) -> Result<NodeId, Inconsistent> {
        // A plan of sixty thousand happenings that are all unsettled is beyond us anyway.
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

    /// Adds `to >= from + distance`, where the network was consistent without it.
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

    /// Moves a node to `time` or later, and all that this moves in turn. When the edges alone would
    /// move `origin`, the new edge from there has closed a cycle that pushes itself.
    fn push(&mut self, node: NodeId, time: Ticks, origin: NodeId) -> Result<(), Inconsistent> {
        self.follow_edges(node, time, origin)?;
        self.enter_windows()
    }

    /// For each node, whether some of the nodes `from` can push it.
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
            // An end that leaves its window pushes the start.
            let windows = self.within.iter().filter(|within| within.last == node);
            waiting.extend(windows.map(|within| within.first));
        }
        is_reached
    }

    /// The same along the edges, whatever the windows.
    fn follow_edges(
        &mut self,
        node: NodeId,
        time: Ticks,
        origin: NodeId,
    ) -> Result<(), Inconsistent> {
        let mut waiting = vec![(node, time)];
        while let Some((node, time)) = waiting.pop() {
            let place = &mut self.nodes[node as usize];
            if time <= place.earliest {
                continue;
            }
            if time > place.latest || node == origin {
                return Err(Inconsistent);
            }
            place.earliest = time;
            for edge in self.edges.iter().filter(|edge| edge.from == node) {
                waiting.push((edge.to, time + edge.distance));
            }
            if (node as usize) < self.closed {
                for (to, &distance) in (0..).zip(self.row(node)) {
                    if distance > -NEVER && to != node {
                        waiting.push((to, time + distance));
                    }
                }
            }
        }
        Ok(())
    }

    /// Makes a node happen no earlier than `time`.
    pub(crate) fn delay(&mut self, node: NodeId, time: Ticks) -> Result<(), Inconsistent> {
        let floor = &mut self.nodes[node as usize].floor;
        *floor = (*floor).max(time);
        self.push(node, time, SETTLED)
    }

    /// Makes a node happen no later than `time`.
    pub(crate) fn hurry(&mut self, node: NodeId, time: Ticks) -> Result<(), Inconsistent> {
        let place = &mut self.nodes[node as usize];
        place.latest = place.latest.min(time);
        if place.earliest > place.latest {
            return Err(Inconsistent);
        }
        Ok(())
    }

    /// Notes that a node has set an annotation. Older nodes that are known to come before it need
    /// not be remembered for that annotation.
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

    /// Lets everything happen at its earliest time, and leave the network.
    pub(crate) fn settle_all(&mut self, settle: &mut dyn FnMut(u32, Ticks)) {
        for &(annotation, node) in &self.marks {
            settle(annotation, self.nodes[node as usize].earliest);
        }
        *self = Self::with_windows(self.windows.take());
    }

    /// Keeps only what the nodes `open` can still push. Hands the annotations and times of what is
    /// settled to `settle`, and returns the new names of the nodes.
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
        // No kept node can push a settled one, so an edge with a kept source is kept whole.
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

    /// The distances from a node to those in the matrix.
    fn row(&self, node: NodeId) -> &[Ticks] {
        let begin = node as usize * self.closed;
        &self.matrix[begin..begin + self.closed]
    }

    /// Keeps only some nodes, with all distances that follow among them: what the network allows
    /// these nodes stays the same. Returns the new names of the nodes; none of the others may be
    /// marked, or be pushed to another window.
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

    /// The distances between all nodes, row by row: those of the matrix, and what new nodes and
    /// their edges add to them.
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

    /// For each node, the least time it must come after `origin`; `-NEVER` if it need not.
    pub(crate) fn distances_from(&self, origin: NodeId) -> Vec<Ticks> {
        if self.is_closed() && self.closed > 0 {
            return self.row(origin).to_vec();
        }
        debug_assert_eq!(self.closed, 0, "a matrix is asked when it is complete");
        let mut distances = vec![-NEVER; self.nodes.len()];
        distances[origin as usize] = 0;
        // Edges stand in the order of happenings, so that few rounds are needed.
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

    /// The least time by which one node must come after another, where all distances are known;
    /// `-NEVER` if it need not.
    pub(crate) fn distance(&self, from: NodeId, to: NodeId) -> Ticks {
        self.matrix[from as usize * self.closed + to as usize]
    }

    /// Whether all distances are known.
    pub(crate) fn is_closed(&self) -> bool {
        self.edges.is_empty() && self.closed == self.nodes.len()
    }

    /// How late a node can be so that nothing it pushes is too late.
    pub(crate) fn latest_given(&self, distances: &[Ticks]) -> Ticks {
        let nodes = self.nodes.iter().zip(distances);
        nodes
            .filter(|(node, distance)| node.latest < NEVER && **distance > -NEVER)
            .map(|(node, distance)| node.latest - distance)
            .min()
            .unwrap_or(NEVER)
    }

    /// All constraints between nodes, as `(from, to, distance)`.
    pub(crate) fn edges(&self) -> impl Iterator<Item = (NodeId, NodeId, Ticks)> + '_ {
        self.edges
            .iter()
            .map(|edge| (edge.from, edge.to, edge.distance))
    }

    /// The bounds of each node by itself: the time before which it cannot happen, whatever else
    /// does, and the latest one.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = (Ticks, Ticks)> + '_ {
        self.nodes.iter().map(|node| (node.floor, node.latest))
    }

    /// Gives back memory that was reserved for growth, which a stored network does not need.
    pub(crate) fn shrink(&mut self) {
        self.nodes.shrink_to_fit();
        self.edges.shrink_to_fit();
        self.marks.shrink_to_fit();
    }

    /// An estimate of the memory it takes, in bytes.
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
