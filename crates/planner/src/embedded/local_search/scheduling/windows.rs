//! Windows of happenings, as orders of a happening and the gaps between its intervals.

use super::super::super::windows::Interval;
use super::model::{Model, snap_of};
use super::times::{Edge, UNBOUNDED};

impl Model<'_> {
    /// Keeps all happenings in their windows, and starts and ends in the same ones.
    pub(super) fn keep_windows(&mut self) -> Option<()> {
        let compiled = self.compiled;
        let Some(windows) = &compiled.windows else {
            return Some(());
        };
        // A node to which all fixed times are relative.
        let zero = u32::try_from(self.items.len()).ok()?;
        self.solver.times.add(0, 0);
        for (node, item) in (0..).zip(self.items.clone()) {
            let snap = snap_of(compiled, item).map(|snap| compiled.snap(snap));
            if let Some(list) = snap.and_then(|snap| snap.dates.windows) {
                self.keep_within(zero, windows.list(list), (node, node));
            }
        }
        for number in 0..self.blocks.len() {
            let block = &self.blocks[number];
            let (Some(&first), Some(&end)) = (block.nodes.first(), block.nodes.last()) else {
                continue;
            };
            let item = self.items[end as usize];
            let action = compiled.actions.get(item.action as usize);
            let Some(list) = action.and_then(|action| action.dates.windows) else {
                continue;
            };
            if self.blocks[number].start.is_some() {
                if let Some(latest) = compiled.latest_end_in_window(item.action) {
                    self.solver.times.bound(end, -UNBOUNDED, latest);
                }
            } else {
                self.keep_within(zero, windows.list(list), (first, end));
            }
        }
        Some(())
    }

    /// Requires that both happenings are in one interval: before each gap, or after it.
    fn keep_within(&mut self, zero: u32, intervals: &[Interval], (first, last): (u32, u32)) {
        let (Some(begin), Some(end)) = (intervals.first(), intervals.last()) else {
            return;
        };
        let times = &mut self.solver.times;
        times.bound(first, begin.0, UNBOUNDED);
        times.bound(last, -UNBOUNDED, end.1);
        for gap in intervals.windows(2) {
            let before = Edge {
                from: last,
                to: zero,
                distance: -gap[0].1,
            };
            let after = Edge {
                from: zero,
                to: first,
                distance: gap[1].0,
            };
            self.solver.variable(true, [Some(before), Some(after)]);
            self.size += 2;
        }
    }
}
