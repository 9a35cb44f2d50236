//! `PExec`: chooses the next happening of an order in the present circumstances.
//!
//! Paper 2, Algorithm 1: of all layers of the order that fit the belief, the last one determines
//! the next happening. This skips superfluous happenings, and repeats failed ones. Where Algorithm
//! 1 and its explanation differ, the implementation follows the explanation: line 5 is meant to
//! return the last layer when *nothing* is running. Running actions end before the goal is
//! declared.
//!
//! A layer only fits if the running actions are exactly those of the layer. (The paper requires
//! less: for an end, that its action is running. But then the executor could continue an order
//! after the end of an action that is still running, which would never be ended.)

mod layer_requirements;
mod order_tracking;

use std::ops::ControlFlow;

use elbowroom_model::ground::Expression;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::model::evaluate;
use crate::network::{Happenings, TooCoupled};
use crate::search::{OrderSearch, Progress};
use crate::search_state::SearchState;
use crate::total_order::{Slot, TotalOrderPlan};
use order_tracking::OrderTracker;

/// Next step of an order's execution.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// The goal holds, no action is running, and no pending timed initial changes a fact or number
    /// that the goal reads.
    GoalReached,
    /// The next happening.
    Next(NextHappening),
    /// Abandon this action, because its end is not worth waiting for. Only a
    /// [`Table`](crate::optimum::Table) returns this.
    Abandon(InstanceId),
    /// No order of the plan leads to the goal from here.
    Replan,
}

/// Next happening of the current order.
#[derive(Clone, Debug, PartialEq)]
pub struct NextHappening {
    /// The happening, as a node of the plan. The executor performs a start or an instantaneous
    /// action, and waits for the end of an action or for a timed initial.
    pub node: NodeId,
    /// Its position in the order.
    pub position: usize,
    /// Subsequent happenings of the order at the same moment, because they need each other.
    pub together: Vec<NodeId>,
    /// Time window of the happening.
    pub slot: Slot,
    /// `true` if the order is new.
    pub is_new_order: bool,
}

/// Policy for searching a new order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reconsider {
    /// When no layer of the current one fits, as in the paper.
    #[default]
    WhenNoLayerFits,
    /// Before each happening. The order is then always the most likely one from here.
    Always,
}

/// Chooses the happenings of one plan, one after the other.
#[doc(alias = "PExec")]
#[derive(Clone, Debug)]
pub struct LayerDispatch {
    search: OrderSearch,
    reconsider: Reconsider,
    order: Option<TotalOrderPlan>,
    /// Number of timed initials before the order's beginning.
    passed_timed: usize,
    /// Cached data of the order, created on first use.
    tracker: Option<OrderTracker>,
}

impl LayerDispatch {
    /// Creates a dispatcher without an order.
    pub fn new(search: OrderSearch, reconsider: Reconsider) -> Self {
        Self {
            search,
            reconsider,
            order: None,
            passed_timed: 0,
            tracker: None,
        }
    }

    /// Returns the current order.
    pub fn order(&self) -> Option<&TotalOrderPlan> {
        self.order.as_ref()
    }

    /// Keeps an order from now on for as long as a layer of it fits. Returns `false` if this was
    /// the policy before.
    pub fn keep_order(&mut self) -> bool {
        std::mem::replace(&mut self.reconsider, Reconsider::WhenNoLayerFits) == Reconsider::Always
    }

    /// Drops the current order, so that the next choice comes from a new search.
    pub fn drop_order(&mut self) {
        self.order = None;
        self.tracker = None;
    }

    /// Returns the search.
    pub fn search(&self) -> &OrderSearch {
        &self.search
    }

    /// Chooses the next step. `watch` can interrupt a search, as in [`OrderSearch::best_order`].
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn choose(
        &mut self,
        circumstances: &SearchState,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Choice, TooCoupled> {
        if circumstances.running.is_empty() && self.holds_goal(circumstances) {
            return Ok(Choice::GoalReached);
        }
        if let Some(order) = self.order.as_ref().filter(|order| order.has_joined()) {
            let is_kept = |position: usize| {
                self.reconsider == Reconsider::WhenNoLayerFits || order.joined[position]
            };
            let found = lattermost_layer(&self.search, order, circumstances);
            if let Some((position, slot)) = found.filter(|(position, _)| is_kept(*position)) {
                return Ok(next(order, position, slot, false));
            }
        } else if self.reconsider == Reconsider::WhenNoLayerFits
            && let Some(order) = &self.order
        {
            let new = || OrderTracker::new(&self.search, order, self.passed_timed);
            let following = self.tracker.get_or_insert_with(new);
            if let Some((position, slot)) =
                following.last_fitting_layer(&self.search, order, circumstances)
            {
                return Ok(next(order, position, slot, false));
            }
        }
        let found = self.search.best_order(circumstances, watch)?;
        self.order = found.order;
        self.passed_timed = self.search.passed_timed_count(&circumstances.now);
        self.tracker = None;
        let Some(order) = &self.order else {
            return Ok(Choice::Replan);
        };
        match order.slots.first() {
            Some(slot) => Ok(next(order, 0, slot.clone(), true)),
            // The empty order is best although the goal is not believed, so no action of this plan
            // helps.
            None => Ok(Choice::Replan),
        }
    }

    fn holds_goal(&self, circumstances: &SearchState) -> bool {
        self.search.is_goal_settled(&circumstances.now)
            && goal_holds(self.search.model(), circumstances)
    }
}

/// Returns `true` if the goal holds in the most likely state.
pub fn goal_holds(model: &crate::Model, circumstances: &SearchState) -> bool {
    let truth = |fact| circumstances.belief.probability(fact) >= 0.5;
    let value = |leaf: &Expression| circumstances.value(leaf);
    let task = model.task();
    evaluate(task, task.goal(), &truth, &value).unwrap_or(false)
}

/// Returns the position and the time window of the happening after the last layer that fits.
///
/// A layer without enough time for the remaining order does not fit.
///
/// The running time is proportional to the order's length. [`LayerDispatch`] computes the same
/// result faster, with cached data of the order.
pub fn lattermost_layer(
    search: &OrderSearch,
    order: &TotalOrderPlan,
    circumstances: &SearchState,
) -> Option<(usize, Slot)> {
    (0..order.sequence.len()).rev().find_map(|position| {
        let happened = |node: &NodeId| has_just_happened(search, *node, circumstances);
        if !order.layers[position].fits(search.model(), circumstances)
            || !order.joined_before(position).iter().all(happened)
        {
            return None;
        }
        let rest = Happenings::from(order).suffix(position);
        let slots = search.windows_of(circumstances, rest)?;
        slots.into_iter().next().map(|slot| (position, slot))
    })
}

/// Returns `true` if a happening is at this moment.
fn has_just_happened(search: &OrderSearch, node: NodeId, circumstances: &SearchState) -> bool {
    let now = &circumstances.now;
    let mut recent = circumstances.recent.iter();
    let mut running = circumstances.running.iter();
    let start = match search.model().plan().nodes[node.index()] {
        Node::Start(id) => running.find(|running| running.instance == id),
        _ => None,
    };
    start.is_some_and(|running| running.start == *now)
        || recent.any(|(other, time)| *other == node && time == now)
}

fn next(order: &TotalOrderPlan, position: usize, slot: Slot, is_new_order: bool) -> Choice {
    let node = order.sequence[position];
    let behind = order.sequence.iter().zip(&order.joined).skip(position + 1);
    let joined = behind.take_while(|(_, is_joined)| **is_joined);
    let together = joined.map(|(node, _)| *node);
    Choice::Next(NextHappening {
        node,
        position,
        together: together.collect(),
        slot,
        is_new_order,
    })
}

/// Never interrupts a search; a callback.
pub fn never_interrupt(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Returns the time from `now` until the slot begins; 0 if it has begun.
pub fn wait(slot: &Slot, now: &Rational) -> Rational {
    (&slot.earliest - now).max(Rational::ZERO)
}
