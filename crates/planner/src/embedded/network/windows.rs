//! Windows for nodes of the network.

use super::super::windows::Interval;
use super::{Inconsistent, NEVER, Network, NodeId, SETTLED, Ticks};

/// Constraint that `first` and `last` are in the same interval of a list, with `tail` remaining
/// after `last`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Within {
    /// The list of intervals.
    pub(crate) windows: u32,
    pub(crate) tail: Ticks,
    pub(crate) first: NodeId,
    pub(crate) last: NodeId,
}

impl Network {
    /// Moves nodes to their next windows until each is in one. Each move is to a later interval, so
    /// the loop terminates.
    pub(super) fn enter_windows(&mut self) -> Result<(), Inconsistent> {
        let mut has_moved = true;
        while has_moved {
            has_moved = false;
            for place in 0..self.within.len() {
                let within = self.within[place];
                let (interval, _) = self.interval_of(within).ok_or(Inconsistent)?;
                if self.earliest(within.first) < interval.0 {
                    // The move may push other nodes out of their windows.
                    self.follow_edges(within.first, interval.0, SETTLED)?;
                    has_moved = true;
                }
            }
        }
        Ok(())
    }

    /// Returns the earliest interval that contains the nodes, and whether it is the last one.
    pub(crate) fn interval_of(&self, within: Within) -> Option<(Interval, bool)> {
        let last = self.earliest(within.first).max(self.earliest(within.last));
        self.windows
            .as_ref()?
            .fit(within.windows, last, within.tail)
    }

    /// Returns the earliest time, not before `time`, within the intervals of a list.
    pub(crate) fn in_window(&self, windows: u32, time: Ticks) -> Option<Ticks> {
        let (interval, _) = self.windows.as_ref()?.fit(windows, time, 0)?;
        Some(time.max(interval.0))
    }

    /// Requires that the nodes are in the same interval of the list, with `tail` remaining after
    /// the second one. For a start by itself, both are the same node.
    pub(crate) fn keep_within(&mut self, within: Within) -> Result<(), Inconsistent> {
        // The constraint on both nodes implies the one on the start alone.
        if within.first != within.last {
            self.within.retain(|known| {
                (known.windows, known.first, known.last)
                    != (within.windows, within.first, within.first)
            });
        }
        self.within.push(within);
        self.enter_windows()
    }

    /// Returns the possible intervals of the nodes, in ascending order.
    pub(crate) fn fitting(&self, within: Within) -> impl Iterator<Item = Interval> + '_ {
        let lists = self.windows.iter();
        let intervals = lists.flat_map(move |lists| lists.list(within.windows));
        let fits = move |(begin, end): &Interval| *begin <= end - within.tail;
        intervals.copied().filter(fits)
    }

    /// Returns a network with an interval in place of each constraint by windows. Precondition: the earliest times are within the intervals.
    pub(crate) fn in_intervals(&self, intervals: &[Interval]) -> Self {
        let mut network = self.clone();
        for (within, &(begin, end)) in std::mem::take(&mut network.within).iter().zip(intervals) {
            let floor = &mut network.nodes[within.first as usize].floor;
            *floor = (*floor).max(begin);
            if end < NEVER {
                let latest = &mut network.nodes[within.last as usize].latest;
                *latest = (*latest).min(end - within.tail);
            }
        }
        network
    }

    /// Returns the constraints by windows.
    pub(crate) fn within(&self) -> &[Within] {
        &self.within
    }

    /// Turns windows without a later interval into latest times.
    pub(super) fn forget_last_windows(&mut self) {
        for place in (0..self.within.len()).rev() {
            let within = self.within[place];
            if let Some(((_, end), true)) = self.interval_of(within) {
                if end < NEVER {
                    let latest = &mut self.nodes[within.last as usize].latest;
                    *latest = (*latest).min(end - within.tail);
                }
                self.within.swap_remove(place);
            }
        }
    }

    /// Keeps the windows of nodes that have a new name, and renames the nodes.
    pub(super) fn rename_within(&mut self, names: &[NodeId]) {
        self.within.retain_mut(|within| {
            within.first = names[within.first as usize];
            within.last = names[within.last as usize];
            within.first != SETTLED && within.last != SETTLED
        });
    }

    /// Returns for each node with windows the beginning of its earliest window.
    pub(crate) fn window_begins(&self) -> impl Iterator<Item = (NodeId, Ticks)> + '_ {
        let within = self.within.iter();
        within.filter_map(|&within| Some((within.first, self.interval_of(within)?.0.0)))
    }
}
