//! Choice of the next happening, by orders of a plan or by the table of a small world:
//! [`HappeningChooser`].

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_probability::optimum::PolicyTable;
use elbowroom_probability::search::Progress;
use elbowroom_probability::{
    Choice, LayerDispatch, NextHappening, OrderSearch, SearchState, TooCoupled,
};

use crate::reason::Subject;

/// The policy that chooses the next happening.
#[derive(Clone)]
pub(super) enum HappeningChooser {
    /// Orders of the plan's happenings, and their layers.
    OrderSearch(Box<LayerDispatch>),
    /// The best action by the table of a small world.
    Table {
        table: Arc<PolicyTable>,
        search: Box<OrderSearch>,
        /// Value of the state at the last choice.
        value: f64,
    },
}

impl HappeningChooser {
    /// Returns the search with its model of happenings and times.
    pub(super) fn search(&self) -> &OrderSearch {
        match self {
            Self::OrderSearch(dispatch) => dispatch.search(),
            Self::Table { search, .. } => search,
        }
    }

    /// Returns the next choice. `watch` can interrupt a search.
    pub(super) fn choose(
        &mut self,
        circumstances: &SearchState,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Choice, TooCoupled> {
        match self {
            Self::OrderSearch(dispatch) => dispatch.choose(circumstances, watch),
            Self::Table {
                table,
                search,
                value,
            } => {
                *value = table.value(circumstances);
                Ok(table.choose(search, circumstances))
            }
        }
    }

    /// Returns `true` if the policy is a table.
    pub(super) fn is_table(&self) -> bool {
        matches!(self, Self::Table { .. })
    }

    /// Keeps an order for as long as it fits, from now on. Returns `false` if this was already the
    /// policy.
    pub(super) fn keep_order(&mut self) -> bool {
        match self {
            Self::OrderSearch(dispatch) => dispatch.keep_order(),
            Self::Table { .. } => false,
        }
    }

    /// Drops the present order, so that the next choice searches again. Returns `false` if there is
    /// no order, if it is new, or if it has to be kept. With `has_happened`, the next happening has
    /// already happened at this moment.
    pub(super) fn drop_order(&mut self, next: &NextHappening, has_happened: bool) -> bool {
        match self {
            Self::OrderSearch(dispatch) if !next.is_new_order => {
                // Between happenings of one moment, nothing else can be started.
                let order = dispatch.order();
                let is_joined = order.is_some_and(|order| order.joined[next.position]);
                let can_be_dropped = has_happened || !is_joined;
                if can_be_dropped {
                    dispatch.drop_order();
                }
                can_be_dropped
            }
            Self::OrderSearch(_) | Self::Table { .. } => false,
        }
    }

    /// Returns the reason for this choice.
    pub(super) fn subject(&self, next: &NextHappening) -> Subject {
        match self {
            Self::Table { value, .. } => Subject::BestChoice(*value),
            Self::OrderSearch(dispatch) if next.is_new_order => {
                let probability = dispatch.order().map_or(0.0, |order| order.probability);
                Subject::FirstInBestOrder(probability)
            }
            Self::OrderSearch(_) => Subject::NextInOrder,
        }
    }
}
