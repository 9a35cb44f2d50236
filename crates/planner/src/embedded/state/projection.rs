//! The unsettled past of a state, seen from what can still be pushed.

use super::super::network::{NodeId, SETTLED};
use super::super::time::{NEVER, Ticks};
use super::State;

/// The network of a state, seen from what can still be pushed: the starts under way.
///
/// Later happenings only push these, and are only pushed by the annotations. So of two states that
/// are discretely the same and whose settled pasts compare, the one with the smaller distances and
/// the later latest times allows every schedule that the other allows. A happening that may have to
/// move to a later window is looked at as a start is; for each window left here, the other state
/// must have one from the same list.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    rows: Vec<Row>,
    /// How many of the rows are those of starts under way, and of what was chosen last.
    open: usize,
    windows: Vec<Window>,
}

/// The distances from one node.
#[derive(Clone, Debug)]
struct Row {
    earliest: Ticks,
    /// How late it can be.
    latest: Ticks,
    /// The least distances to the nodes of all rows: the starts under way, what was chosen last
    /// where choices come in the order of time, and what has windows.
    to_rows: Vec<Ticks>,
    /// The least distances to the annotations, by annotation.
    to_annotations: Vec<(u32, Ticks)>,
}

/// The rows of the nodes that lie in one interval of a list.
#[derive(Clone, Copy, Debug)]
struct Window {
    windows: u32,
    tail: Ticks,
    first: usize,
    last: usize,
}

/// No row yet.
const NO_ROW: usize = usize::MAX;

impl State {
    /// The part of the unsettled past that matters: everything that later choices can push, and how
    /// far.
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

    /// The windows of unsettled happenings, whose nodes join those of the rows.
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
    /// Whether what can follow the other, in time, can follow this. With `is_timeless`, only
    /// distances matter, as nothing happens at a fixed time.
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

    /// For each row, the row of the other projection that is compared with it. `None` if a window is left
    /// here that the other does not have.
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

    /// An estimate of the memory it takes, in bytes.
    pub(crate) fn size(&self) -> usize {
        let row = |row: &Row| {
            size_of::<Row>() + 8 * row.to_rows.capacity() + 16 * row.to_annotations.capacity()
        };
        let rows: usize = self.rows.iter().map(row).sum();
        rows + size_of::<Window>() * self.windows.capacity()
    }
}
