//! The current order with cached data for the next decisions: [`Following`].

use elbowroom_plan::Node;

use super::demands::Demands;
use crate::circumstances::Circumstances;
use crate::search::{First, OrderSearch, Rests};
use crate::total_order::{Slot, TotalOrderPlan};

/// Layers of an order that fit, and time windows of its suffixes. Gives the same result as
/// [`lattermost_layer`](super::lattermost_layer), which does not use cached data.
#[derive(Clone, Debug)]
pub(super) struct Following {
    demands: Demands,
    rests: Rests,
    /// After the last timed initial of the order, others may have passed that are not part of it.
    late: Option<Rests>,
}

impl Following {
    /// Creates the cached data for an order that begins after `passed` timed initials.
    pub(super) fn new(search: &OrderSearch, order: &TotalOrderPlan, passed: usize) -> Self {
        Self {
            demands: Demands::of(order),
            rests: search.rests(order, 0, passed),
            late: None,
        }
    }

    /// Returns the position and the time window of the happening after the last layer that fits.
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
            // The next timed initial is not the next one of the order.
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
