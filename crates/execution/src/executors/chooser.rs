//! Who chooses the next happening of a plan, or of everything that can be done: [`Chooser`].

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_probability::optimum::Table;
use elbowroom_probability::search::Progress;
use elbowroom_probability::{
    Choice, Circumstances, LayerDispatch, NextHappening, OrderSearch, TooCoupled,
};

use crate::reason::About;

/// The policy that chooses the next happening.
#[derive(Clone)]
pub(super) enum Chooser {
    /// Orders of the plan's happenings, and their layers.
    Orders(Box<LayerDispatch>),
    /// The best action by the table of a small world.
    Table {
        table: Arc<Table>,
        search: Box<OrderSearch>,
        /// The value of the state in which was chosen last.
        value: f64,
    },
}

impl Chooser {
    /// The model whose happenings are chosen, with its times.
    pub(super) fn search(&self) -> &OrderSearch {
        match self {
            Self::Orders(dispatch) => dispatch.search(),
            Self::Table { search, .. } => search,
        }
    }

    /// The next choice. `watch` can interrupt a search.
    pub(super) fn choose(
        &mut self,
        circumstances: &Circumstances,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Choice, TooCoupled> {
        match self {
            Self::Orders(dispatch) => dispatch.choose(circumstances, watch),
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

    /// Why this is next.
    pub(super) fn about(&self, next: &NextHappening) -> About {
        match self {
            Self::Table { value, .. } => About::BestOfAll(*value),
            Self::Orders(dispatch) if next.is_new_order => {
                let probability = dispatch.order().map_or(0.0, |order| order.probability);
                About::FirstOfBestOrder(probability)
            }
            Self::Orders(_) => About::NextInOrder,
        }
    }
}
