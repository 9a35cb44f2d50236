//! What has been looked at before.

use super::super::state::{Projection, State};
use super::Search;

impl Search<'_> {
    /// Whether a state that is at least as good has been looked at.
    pub(super) fn is_known(
        &mut self,
        hash: u64,
        state: &State,
        projection: Option<&Projection>,
    ) -> bool {
        if state.joint.is_some() {
            return false;
        }
        let Some(similar) = self.known.get(&hash) else {
            return false;
        };
        let mut variants = 0;
        for &number in similar {
            let node = &self.nodes[number as usize];
            let other = &node.state;
            if other.joint.is_none() && other.is_discretely(state) {
                let mut is_no_later =
                    self.is_timeless || other.has_no_later_annotations_than(state);
                is_no_later &= self.step_costs.is_none() || other.cost <= state.cost;
                if self.strategy.compresses.is_some() {
                    self.has_lost |= is_no_later && !state.network.is_empty();
                }
                if let (Some(mine), Some(theirs)) = (&node.projection, projection) {
                    is_no_later = is_no_later && mine.is_no_later_than(theirs, self.is_timeless);
                }
                if is_no_later {
                    return true;
                }
                variants += 1;
            }
        }
        if variants >= self.strategy.variants {
            self.has_lost = true;
            return true;
        }
        false
    }
}
