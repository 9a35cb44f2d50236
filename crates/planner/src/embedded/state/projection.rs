//! Projection of a state's unsettled happenings to those that can still be delayed.

use super::super::network::{NodeId, SETTLED};
use super::super::time::{NEVER, Ticks};
use super::State;

/// The network of a state, projected to the nodes that can still be delayed: the starts of running
/// actions.
///
/// Later happenings delay only these, and are delayed only by the annotations. So of two states
/// that are discretely the same and whose settled parts compare, the one with the smaller distances
/// and the later latest times allows every schedule that the other allows. A happening that may
/// have to move to a later window is treated like a start. For each window left here, the other
/// state must have one from the same list.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    rows: Vec<Row>,
    /// Number of rows for the starts of running actions and the last choice.
    open: usize,
    windows: Vec<Window>,
}

/// The distances from one node.
#[derive(Clone, Debug)]
struct Row {
    earliest: Ticks,
    /// Latest time of the node.
    latest: Ticks,
    /// The least distances to the nodes of all rows: the starts of running actions, the last choice
    /// where choices come in chronological order, and happenings with windows.
    to_rows: Vec<Ticks>,
    /// The least distances to the annotations, by annotation.
    to_annotations: Vec<(u32, Ticks)>,
}

/// The rows of the nodes that must be in one interval of a list.
#[derive(Clone, Copy, Debug)]
struct Window {
    windows: u32,
    tail: Ticks,
    first: usize,
    last: usize,
}

/// No row assigned.
const NO_ROW: usize = usize::MAX;

impl State {
    /// Returns the relevant part of the unsettled happenings: those that later choices can delay,
    /// with their bounds.
    pub(crate) fn projection(&self) -> Projection {
        let nodes = self.open.iter().map(|open| open.node);
        let mut nodes: Vec<NodeId> = nodes
            .chain([self.last.node])
            .filter(|&node| node != SETTLED)
            .collect();
        let open = nodes.len();
        let windows = self.windows(&mut nodes);
        let rows = nodes.iter().map(|&node| {
            let distances = self.network.distances_from(node);
            let mut to_annotations: Vec<(u32, Ticks)> = self
                .network
                .marks
                .iter()
                .map(|&(annotation, node)| (annotation, distances[node as usize]))
                .filter(|&(_, distance)| distance > -NEVER)
                .collect();
            to_annotations.sort_unstable_by_key(|&(annotation, distance)| (annotation, -distance));
            to_annotations.dedup_by_key(|&mut (annotation, _)| annotation);
            Row {
                earliest: self.network.earliest(node),
                latest: self.network.latest_given(&distances),
                to_rows: nodes.iter().map(|&o| distances[o as usize]).collect(),
                to_annotations,
            }
        });
        Projection {
            rows: rows.collect(),
            open,
            windows,
        }
    }

    /// Adds the nodes of windows to those of the rows. Returns the windows of unsettled happenings.
    fn windows(&self, nodes: &mut Vec<NodeId>) -> Vec<Window> {
        let mut all = self.network.within().to_vec();
        let earliest = |node| self.network.earliest(node);
        all.sort_by_key(|w| (w.windows, w.tail, earliest(w.first), earliest(w.last)));
        let mut row = |node: NodeId| {
            nodes.iter().position(|&n| n == node).unwrap_or_else(|| {
                nodes.push(node);
                nodes.len() - 1
            })
        };
        let windows = all.iter().map(|within| Window {
            windows: within.windows,
            tail: within.tail,
            first: row(within.first),
            last: row(within.last),
        });
        windows.collect()
    }
}

impl Projection {
    /// Returns `true` if every schedule that can follow the other state can also follow this one.
    /// If `is_timeless`, only distances matter, since no happening has a fixed time.
    pub(crate) fn is_no_later_than(&self, other: &Self, is_timeless: bool) -> bool {
        let Some(of) = self.rows_in(other) else {
            return false;
        };
        self.rows.iter().zip(&of).all(|(mine, &theirs)| {
            let theirs = &other.rows[theirs];
            let mut distances = mine.to_rows.iter().zip(&of);
            (is_timeless || mine.earliest <= theirs.earliest)
                && mine.latest >= theirs.latest
                && distances.all(|(&distance, &row)| distance <= theirs.to_rows[row])
                && mine.to_annotations.iter().all(|&(annotation, distance)| {
                    theirs
                        .to_annotations
                        .binary_search_by_key(&annotation, |entry| entry.0)
                        .is_ok_and(|found| distance <= theirs.to_annotations[found].1)
                })
        })
    }

    /// Returns for each row the row of the other projection to compare it with, or `None` if the
    /// other lacks a window that is left here.
    fn rows_in(&self, other: &Self) -> Option<Vec<usize>> {
        let open = 0..self.open.min(other.open);
        let mut rows: Vec<usize> = open.collect();
        rows.resize(self.rows.len(), NO_ROW);
        let mut theirs = other.windows.iter().rev();
        for mine in self.windows.iter().rev() {
            let may_be = |row: usize, other: usize| rows[row] == NO_ROW || rows[row] == other;
            let found = theirs.find(|theirs| {
                (theirs.windows, theirs.tail) == (mine.windows, mine.tail)
                    && (theirs.first == theirs.last) == (mine.first == mine.last)
                    && may_be(mine.first, theirs.first)
                    && may_be(mine.last, theirs.last)
            })?;
            rows[mine.first] = found.first;
            rows[mine.last] = found.last;
        }
        (!rows.contains(&NO_ROW)).then_some(rows)
    }

    /// Returns an estimate of the memory, in bytes.
    pub(crate) fn size(&self) -> usize {
        let row = |row: &Row| {
            size_of::<Row>() + 8 * row.to_rows.capacity() + 16 * row.to_annotations.capacity()
        };
        let rows: usize = self.rows.iter().map(row).sum();
        rows + size_of::<Window>() * self.windows.capacity()
    }
}
