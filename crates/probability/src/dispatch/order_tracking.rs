//! The current order with cached data for the next decisions: [`OrderTracker`].

use elbowroom_plan::Node;

use super::layer_requirements::LayerRequirements;
use crate::search::{FirstWindow, OrderSearch, Suffixes};
use crate::search_state::SearchState;
use crate::total_order::{Slot, TotalOrderPlan};

/// Layers of an order that fit, and time windows of its suffixes. Gives the same result as
/// [`lattermost_layer`](super::lattermost_layer), which does not use cached data.
#[derive(Clone, Debug)]
pub(super) struct OrderTracker {
    requirements: LayerRequirements,
    suffixes: Suffixes,
    /// After the last timed initial of the order, others may have passed that are not part of it.
    late_suffixes: Option<Suffixes>,
}

impl OrderTracker {
    /// Creates the cached data for an order that begins after `passed` timed initials.
    pub(super) fn new(search: &OrderSearch, order: &TotalOrderPlan, passed: usize) -> Self {
        Self {
            requirements: LayerRequirements::of(order),
            suffixes: search.suffixes(order, 0, passed),
            late_suffixes: None,
        }
    }

    /// Returns the position and the time window of the happening after the last layer that fits.
    pub(super) fn last_fitting_layer(
        &mut self,
        search: &OrderSearch,
        order: &TotalOrderPlan,
        circumstances: &SearchState,
    ) -> Option<(usize, Slot)> {
        if !self.requirements.observe(circumstances) {
            return None;
        }
        let mut before = order.sequence.len();
        while let Some(position) = self.requirements.last_met(before) {
            if order.layers[position].conditions_hold(search.model(), circumstances)
                && let Some(slot) = self.first_window(search, order, circumstances, position)
            {
                return Some((position, slot));
            }
            before = position;
        }
        None
    }

    fn first_window(
        &mut self,
        search: &OrderSearch,
        order: &TotalOrderPlan,
        circumstances: &SearchState,
        position: usize,
    ) -> Option<Slot> {
        let passed = search.passed_timed_count(&circumstances.now);
        let first = if self.suffixes.matches(position, passed) {
            search.first_of(&self.suffixes, order, position, circumstances)
        } else if self.suffixes.has_timed(position) {
            // The next timed initial is not the next one of the order.
            FirstWindow::Never
        } else {
            let late = self
                .late_suffixes
                .take()
                .filter(|late| late.matches(position, passed));
            let late = late.unwrap_or_else(|| {
                let nodes = &search.model().plan().nodes;
                let is_timed =
                    |node: &elbowroom_plan::NodeId| matches!(nodes[node.index()], Node::Timed(_));
                let last = order.sequence.iter().rposition(is_timed);
                search.suffixes(order, last.map_or(0, |last| last + 1), passed)
            });
            let first = search.first_of(&late, order, position, circumstances);
            self.late_suffixes = Some(late);
            first
        };
        match first {
            FirstWindow::In(slot) => Some(slot),
            FirstWindow::Never => None,
            FirstWindow::Unknown => {
                let slots = search.windows(circumstances, &order.sequence[position..])?;
                slots.into_iter().next()
            }
        }
    }
}
