//! `PExec`: which happening of an order is next, as things stand.
//!
//! Paper 2, Algorithm 1: of all layers of the order that fit what is believed, the lattermost says
//! what is next. That skips what has become superfluous, and repeats what did not work. Where
//! Algorithm 1 and its explanation differ, this follows the explanation: line 5 is meant to return
//! the last layer when *nothing* is under way; what is under way ends before the goal is declared.
//!
//! A layer fits only where exactly those actions are under way that the order has under way there.
//! (The paper asks for less: that the start of an end is. But then an order could be taken up
//! behind the end of an action that is still running, which would never be ended.)

mod demands;
mod following;

use std::ops::ControlFlow;

use elbowroom_model::ground::Expression;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::circumstances::Circumstances;
use crate::model::evaluate;
use crate::network::{Happenings, TooCoupled};
use crate::search::{OrderSearch, Progress};
use crate::total_order::{Slot, TotalOrderPlan};
use following::Following;

/// The next step of an order's execution.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// The goal holds, nothing is under way, and no timed initial changes what the goal reads any
    /// more.
    GoalReached,
    /// This happening.
    Next(NextHappening),
    /// Let this action go; its end is not worth waiting for. Only a
    /// [`Table`](crate::optimum::Table) says so.
    Abandon(InstanceId),
    /// No order of the plan leads to the goal from here.
    Replan,
}

/// The next happening of the current order.
#[derive(Clone, Debug, PartialEq)]
pub struct NextHappening {
    /// Which one; a node of the plan. A start or an instant is for the executor to do, the end of
    /// an action and a timed initial are to be waited for.
    pub node: NodeId,
    /// Its position in the order.
    pub position: usize,
    /// The happenings behind it in the order that come at the same moment, because they need each other.
    pub together: Vec<NodeId>,
    /// The window in which it may happen.
    pub slot: Slot,
    /// Whether the order is new.
    pub is_new_order: bool,
}

/// The policy for searching a new order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reconsider {
    /// When no layer of the present one fits, as in the paper.
    #[default]
    WhenNoLayerFits,
    /// Before each happening. The order is then always the one most likely to succeed from here.
    Always,
}

/// Chooses happenings of one plan, one after the other.
#[doc(alias = "PExec")]
#[derive(Clone, Debug)]
pub struct LayerDispatch {
    search: OrderSearch,
    reconsider: Reconsider,
    order: Option<TotalOrderPlan>,
    /// How many timed initials had passed when it began.
    passed: usize,
    /// What is kept of the order; made when it is first followed.
    following: Option<Following>,
}

impl LayerDispatch {
    /// With no order yet.
    pub fn new(search: OrderSearch, reconsider: Reconsider) -> Self {
        Self {
            search,
            reconsider,
            order: None,
            passed: 0,
            following: None,
        }
    }

    /// The present order.
    pub fn order(&self) -> Option<&TotalOrderPlan> {
        self.order.as_ref()
    }

    /// From now on keeps an order for as long as a layer of it fits. Returns `false` if that was so before.
    pub fn keep_order(&mut self) -> bool {
        std::mem::replace(&mut self.reconsider, Reconsider::WhenNoLayerFits) == Reconsider::Always
    }

    /// Drops the present order, so that the next choice is that of a new search.
    pub fn drop_order(&mut self) {
        self.order = None;
        self.following = None;
    }

    /// The search behind it.
    pub fn search(&self) -> &OrderSearch {
        &self.search
    }

    /// What to do next. `watch` can cut a search short, as in [`OrderSearch::best_order`].
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn choose(
        &mut self,
        circumstances: &Circumstances,
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
            let new = || Following::new(&self.search, order, self.passed);
            let following = self.following.get_or_insert_with(new);
            if let Some((position, slot)) = following.lattermost(&self.search, order, circumstances)
            {
                return Ok(next(order, position, slot, false));
            }
        }
        let found = self.search.best_order(circumstances, watch)?;
        self.order = found.order;
        self.passed = self.search.timed_passed(&circumstances.now);
        self.following = None;
        let Some(order) = &self.order else {
            return Ok(Choice::Replan);
        };
        match order.slots.first() {
            Some(slot) => Ok(next(order, 0, slot.clone(), true)),
            // Nothing to do is best, though the goal is not believed: no action of this plan helps.
            None => Ok(Choice::Replan),
        }
    }

    fn holds_goal(&self, circumstances: &Circumstances) -> bool {
        self.search.is_goal_settled(&circumstances.now)
            && goal_holds(self.search.model(), circumstances)
    }
}

/// Whether the goal holds of what is more likely than not.
pub fn goal_holds(model: &crate::Model, circumstances: &Circumstances) -> bool {
    let truth = |fact| circumstances.belief.probability(fact) >= 0.5;
    let value = |leaf: &Expression| circumstances.value(leaf);
    let task = model.task();
    evaluate(task, task.goal(), &truth, &value).unwrap_or(false)
}

/// The position of the happening after the lattermost layer that fits, and when it may be.
///
/// A layer after which there is no time for the rest of the order does not fit.
///
/// This takes time in proportion to the order's length. [`LayerDispatch`] finds the same in less, from what
/// it keeps of an order.
pub fn lattermost_layer(
    search: &OrderSearch,
    order: &TotalOrderPlan,
    circumstances: &Circumstances,
) -> Option<(usize, Slot)> {
    (0..order.sequence.len()).rev().find_map(|position| {
        let happened = |node: &NodeId| has_just_happened(search, *node, circumstances);
        if !order.layers[position].fits(search.model(), circumstances)
            || !order.joined_before(position).iter().all(happened)
        {
            return None;
        }
        let rest = Happenings::from(order).rest(position);
        let slots = search.windows_of(circumstances, rest)?;
        slots.into_iter().next().map(|slot| (position, slot))
    })
}

/// Returns `true` if a happening is at this moment.
fn has_just_happened(search: &OrderSearch, node: NodeId, circumstances: &Circumstances) -> bool {
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

/// Lets every search run to its end.
pub fn patient(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// How long until the slot begins, from `now`; 0 if it has.
pub fn wait(slot: &Slot, now: &Rational) -> Rational {
    (&slot.earliest - now).max(Rational::ZERO)
}
