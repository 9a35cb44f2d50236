//! An order under way, with what is kept of it from one decision to the next: [`Following`].

use elbowroom_plan::Node;

use super::demands::Demands;
use crate::circumstances::Circumstances;
use crate::search::{First, OrderSearch, Rests};
use crate::total_order::{Slot, TotalOrderPlan};

/// Which layers of an order fit, and what its rests have time for. It says the same as
/// [`lattermost_layer`](super::lattermost_layer), which looks at everything anew each time.
#[derive(Clone, Debug)]
pub(super) struct Following {
    demands: Demands,
    rests: Rests,
    /// Behind the last timed initial of the order, others may have passed that are not part of it.
    late: Option<Rests>,
}

impl Following {
    /// An order that begins after so many timed initials.
    pub(super) fn new(search: &OrderSearch, order: &TotalOrderPlan, passed: usize) -> Self {
        Self {
            demands: Demands::of(order),
            rests: search.rests(order, 0, passed),
            late: None,
        }
    }

    /// The position of the happening after the lattermost layer that fits, and when it may be.
    pub(super) fn lattermost(
        &mut self,
        search: &OrderSearch,
        order: &TotalOrderPlan,
        circumstances: &Circumstances,
    ) -> Option<(usize, Slot)> {
        if !self.demands.observe(circumstances) {
            return None;
        }
        let mut before = order.sequence.len();
        while let Some(position) = self.demands.last_met(before) {
            if order.layers[position].conditions_hold(search.model(), circumstances)
                && let Some(slot) = self.first(search, order, circumstances, position)
            {
                return Some((position, slot));
            }
            before = position;
        }
        None
    }

    fn first(
        &mut self,
        search: &OrderSearch,
        order: &TotalOrderPlan,
        circumstances: &Circumstances,
        position: usize,
    ) -> Option<Slot> {
        let passed = search.timed_passed(&circumstances.now);
        let first = if self.rests.are_for(position, passed) {
            search.first_of(&self.rests, order, position, circumstances)
        } else if self.rests.have_timed(position) {
            // The next timed initial is not the one that the order has next.
            First::Never
        } else {
            let late = self
                .late
                .take()
                .filter(|late| late.are_for(position, passed));
            let late = late.unwrap_or_else(|| {
                let nodes = &search.model().plan().nodes;
                let is_timed =
                    |node: &elbowroom_plan::NodeId| matches!(nodes[node.index()], Node::Timed(_));
                let last = order.sequence.iter().rposition(is_timed);
                search.rests(order, last.map_or(0, |last| last + 1), passed)
            });
            let first = search.first_of(&late, order, position, circumstances);
            self.late = Some(late);
            first
        };
        match first {
            First::In(slot) => Some(slot),
            First::Never => None,
            First::Unknown => {
                let slots = search.windows(circumstances, &order.sequence[position..])?;
                slots.into_iter().next()
            }
        }
    }
}
