//! Shortest paths: the tightest implied bounds, with the constraints that imply them.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use elbowroom_num::Rational;

use crate::{
    ConsistentNetwork, Constraint, ConstraintId, Direction, NodeId, Schedule, Weight, count_step,
};

/// The tightest implied bound between one node, the root, and each other node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShortestPaths<W = Rational> {
    root: NodeId,
    direction: Direction,
    distances: Vec<Option<W>>,
    /// The edge next to each node, and the node at its other end, one step closer to the root.
    steps: Vec<Option<(ConstraintId, NodeId)>>,
}

impl<W: Weight> ShortestPaths<W> {
    /// Returns the node where all paths begin or end.
    pub fn root(&self) -> NodeId {
        self.root
    }

    /// Returns whether the paths begin or end at the root.
    pub fn direction(&self) -> Direction {
        self.direction
    }

    /// Returns the least `d` with `node - root <= d` (or `root - node <= d`, by direction) in every
    /// schedule; `None` when there is none.
    pub fn distance(&self, node: NodeId) -> Option<&W> {
        self.distances[node.index()].as_ref()
    }

    /// Returns the constraint next to the node on its path.
    pub(crate) fn step(&self, node: NodeId) -> Option<ConstraintId> {
        self.steps[node.index()].map(|(id, _)| id)
    }

    /// Returns the constraints whose sum is the bound, from the beginning of the path to its end;
    /// `None` when there is no bound.
    pub fn path(&self, node: NodeId) -> Option<Vec<ConstraintId>> {
        self.distance(node)?;
        let mut path = Vec::new();
        let mut place = node;
        while let Some((id, nearer)) = self.steps[place.index()] {
            path.push(id);
            place = nearer;
        }
        if self.direction == Direction::FromRoot {
            path.reverse();
        }
        Some(path)
    }
}

impl<W: Weight> ConsistentNetwork<W> {
    /// Returns the tightest bounds on `node - root`, for each node.
    pub fn shortest_paths_from(&self, root: NodeId) -> ShortestPaths<W> {
        self.shortest_paths(root, Direction::FromRoot, None)
    }

    /// Returns the tightest bounds on `root - node`, for each node.
    pub fn shortest_paths_to(&self, root: NodeId) -> ShortestPaths<W> {
        self.shortest_paths(root, Direction::ToRoot, None)
    }

    /// Returns the least `d` with `to - from <= d` in every schedule; `None` when there is none.
    ///
    /// Only nodes that are closer, by slacks in the network's schedule, take time.
    pub fn distance(&self, from: NodeId, to: NodeId) -> Option<W> {
        let network = self.network();
        let key = |distance: &W, node| Direction::FromRoot.key(distance, node, self.schedule());
        let mut distances = BTreeMap::from([(from, W::zero())]);
        let mut are_final = BTreeSet::new();
        let mut queue = BinaryHeap::from([Reverse((key(&W::zero(), from), from))]);
        while let Some(Reverse((_, node))) = queue.pop() {
            count_step();
            let near = distances.get(&node)?.clone();
            if node == to {
                return Some(near);
            }
            if !are_final.insert(node) {
                continue;
            }
            for id in network.leaving(node) {
                let Constraint { to: far, bound, .. } = network.constraint(id);
                let distance = near.plus(bound);
                if distances.get(far).is_none_or(|old| distance < *old) {
                    queue.push(Reverse((key(&distance, *far), *far)));
                    distances.insert(*far, distance);
                }
            }
        }
        None
    }

    /// Returns constraints from `from` to `to` whose bounds sum up to the
    /// [`distance`](Self::distance).
    pub fn shortest_path(&self, from: NodeId, to: NodeId) -> Option<Vec<ConstraintId>> {
        self.shortest_paths(from, Direction::FromRoot, Some(to))
            .path(to)
    }

    /// Runs Dijkstra's algorithm. Distances are final for all nodes, or only for `goal`.
    ///
    /// The queue is ordered by path lengths in slacks ([`Constraint::slack_in`]) of the network's
    /// schedule, without the constant share of the root.
    fn shortest_paths(
        &self,
        root: NodeId,
        direction: Direction,
        goal: Option<NodeId>,
    ) -> ShortestPaths<W> {
        let network = self.network();
        let mut distances: Vec<Option<W>> = vec![None; network.node_count()];
        let mut steps = vec![None; network.node_count()];
        let mut is_final = vec![false; network.node_count()];
        let mut queue = BinaryHeap::new();
        distances[root.index()] = Some(W::zero());
        queue.push(Reverse((
            direction.key(&W::zero(), root, self.schedule()),
            root,
        )));
        while let Some(Reverse((_, node))) = queue.pop() {
            count_step();
            if std::mem::replace(&mut is_final[node.index()], true) {
                continue;
            }
            if goal == Some(node) {
                break;
            }
            let mut next = network.first(node, direction);
            while let Some(id) = next {
                next = network.after(id, direction);
                let constraint = network.constraint(id);
                let far = direction.far_end(constraint);
                if is_final[far.index()] {
                    continue;
                }
                let Some(near) = &distances[node.index()] else {
                    continue;
                };
                let distance = near.plus(&constraint.bound);
                if distances[far.index()]
                    .as_ref()
                    .is_none_or(|old| distance < *old)
                {
                    queue.push(Reverse((
                        direction.key(&distance, far, self.schedule()),
                        far,
                    )));
                    distances[far.index()] = Some(distance);
                    steps[far.index()] = Some((id, node));
                }
            }
        }
        ShortestPaths {
            root,
            direction,
            distances,
            steps,
        }
    }
}

impl Direction {
    pub(crate) fn far_end<W>(self, constraint: &Constraint<W>) -> NodeId {
        match self {
            Direction::FromRoot => constraint.to,
            Direction::ToRoot => constraint.from,
        }
    }

    pub(crate) fn opposite(self) -> Self {
        match self {
            Direction::FromRoot => Direction::ToRoot,
            Direction::ToRoot => Direction::FromRoot,
        }
    }

    pub(crate) fn key<W: Weight>(self, distance: &W, node: NodeId, schedule: &Schedule<W>) -> W {
        match self {
            Direction::FromRoot => distance.minus(&schedule[node]),
            Direction::ToRoot => distance.plus(&schedule[node]),
        }
    }
}
