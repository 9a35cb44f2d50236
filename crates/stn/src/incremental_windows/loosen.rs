//! Loosening of constraints.

use super::{IncrementalWindows, Source, WindowEnd};
use crate::direction::Direction;
use crate::{ConstraintId, NodeId, Weight};

impl<W: Weight> IncrementalWindows<W> {
    /// Loosens a constraint to `to - from <= bound`, or lifts it if `bound` is `None`. A bound that
    /// is tighter than the current one changes nothing.
    ///
    /// Costs time in proportion to the window ends that depend on the constraint, and to the
    /// constraints at these nodes. Their paths are searched again, from nodes whose window ends do
    /// not depend on it (cf. Ramalingam & Reps, *J. Algorithms* 21, 1996, on deletions).
    pub fn loosen(&mut self, id: ConstraintId, bound: Option<W>) {
        match bound {
            None if self.is_lifted(id) => return,
            None => self.is_lifted[id.index()] = true,
            Some(bound) => {
                if self.is_lifted(id) || bound <= self.network.constraint(id).bound {
                    return;
                }
                self.network.set_bound(id, bound);
            }
        }
        for direction in [Direction::FromRoot, Direction::ToRoot] {
            let far = direction.far_end(self.network.constraint(id));
            if self.source(direction, far) == Source::Constraint(id) {
                self.recompute(direction, far);
            }
        }
    }

    /// Recomputes the distances of `node`, and of all nodes whose paths contain it.
    fn recompute(&mut self, direction: Direction, node: NodeId) {
        let mut lost = vec![node];
        let mut at = 0;
        while let Some(&near) = lost.get(at) {
            at += 1;
            let mut next = self.network.first(near, direction);
            while let Some(id) = next {
                next = self.network.after(id, direction);
                let far = direction.far_end(self.network.constraint(id));
                // The paths form a tree, so no node is visited twice.
                if self.source(direction, far) == Source::Constraint(id) {
                    lost.push(far);
                }
            }
        }
        for &node in &lost {
            self.clear_distance(direction, node);
        }
        for &node in &lost {
            if let Some(limit) = self.limit(direction, node) {
                self.shorten(direction, node, limit, Source::Limit);
            }
            let back = direction.opposite();
            let mut next = self.network.first(node, back);
            while let Some(id) = next {
                next = self.network.after(id, back);
                if self.is_lifted(id) {
                    continue;
                }
                let constraint = self.network.constraint(id);
                // A neighbour whose window end is also lost is queued when it is found again.
                let Some(near) = self.distance(direction, back.far_end(constraint)) else {
                    continue;
                };
                let through = near.plus(&constraint.bound);
                let old = self.distance(direction, node);
                if old.is_none_or(|old| through < old) {
                    self.shorten(direction, node, through, Source::Constraint(id));
                }
            }
        }
        self.propagate(direction);
    }

    fn source(&self, direction: Direction, node: NodeId) -> Source {
        self.sources[node.index()][end(direction) as usize]
    }

    /// Returns the node's own limit as a distance.
    fn limit(&self, direction: Direction, node: NodeId) -> Option<W> {
        let limit = self.limits[node.index()][end(direction) as usize].as_ref()?;
        Some(match direction {
            Direction::FromRoot => limit.clone(),
            Direction::ToRoot => limit.negated(),
        })
    }

    fn clear_distance(&mut self, direction: Direction, node: NodeId) {
        let window = &mut self.windows[node.index()];
        match direction {
            Direction::FromRoot => window.latest = None,
            Direction::ToRoot => window.earliest = None,
        }
        self.sources[node.index()][end(direction) as usize] = Source::Nothing;
    }
}

fn end(direction: Direction) -> WindowEnd {
    match direction {
        Direction::FromRoot => WindowEnd::Latest,
        Direction::ToRoot => WindowEnd::Earliest,
    }
}
