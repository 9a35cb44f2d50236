//! `PGen`: finds the order of a plan's happenings that is most likely to succeed.
//!
//! Branch and bound over sequences of happenings (paper 2, section 2.2.1), depth first, the most
//! promising happening first. A sequence is pruned in these cases:
//!
//! - Its happenings are impossible in this order without failures, or succeed with probability 0.
//! - It has no schedule: durations, their bounds, timed initials and the present time are
//!   inconsistent.
//! - No continuation can be better than the best known order (by a sharper bound than the paper's
//!   P(A), see `search/bound.rs`).
//! - Another sequence with the same happenings dominates it (see `search/memo.rs`).
//! - A symmetric sequence exists, with interchangeable instances exchanged (see
//!   `search/symmetry.rs`).
//!
//! In contrast to the published code, it keeps the best order, starts from the present belief, and
//! can repeat actions that were executed before.

mod assignment;
mod bound;
mod cache;
mod chain;
mod coupling;
mod lattice;
mod memo;
mod nominal;
mod postponed;
mod queue;
mod run;
mod separations;
mod symmetry;
mod time_slack;
mod timing;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_num::Rational;
use elbowroom_plan::{Node, NodeId};

use crate::model::Model;
use crate::network::{Happenings, PrunedNetwork, TooCoupled};
use crate::search_state::SearchState;
use crate::total_order::{Slot, TotalOrderPlan};
use bound::Bounds;
use cache::Cache;
use coupling::Couplings;
pub use lattice::{Lattice, LatticeEdge, LatticeLimits, LatticeNode, TooLarge};
use nominal::Nominal;
use run::{Best, Run};
use separations::Separations;
use symmetry::Symmetry;
use time_slack::TimeSlacks;
pub(crate) use time_slack::{FirstWindow, Suffixes};
use timing::Timing;

/// Sequences that count as orders of the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Candidates {
    /// Sequences that reach the goal without failures, as in the paper.
    #[default]
    Working,
    /// All sequences. An order may then rely on a spontaneous change of a fact.
    All,
}

/// Settings of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSettings {
    /// Sequences that count.
    pub candidates: Candidates,
    /// `true` if happenings keep the order of the plan's interference links, as in the paper.
    /// Otherwise, only conditions and likelihoods matter.
    pub keeps_interference: bool,
}

impl Default for SearchSettings {
    /// Returns the settings of the paper.
    fn default() -> Self {
        Self {
            candidates: Candidates::Working,
            keeps_interference: true,
        }
    }
}

/// Work units of each examined sequence, for [`elbowroom_num::work`].
const SEQUENCE_WORK: u64 = 5_000;

/// Reason why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchStop {
    /// The result is optimal.
    Complete,
    /// The callback interrupted the search; there may be better orders.
    Interrupted,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchResult {
    /// The most likely order; `None` if no order can succeed.
    pub order: Option<TotalOrderPlan>,
    /// `Complete` if the order is proven to be the best.
    pub stop: SearchStop,
    /// Number of examined sequences; 0 if the result was cached.
    pub sequences: usize,
}

/// Progress of a search, for its callback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Number of sequences examined until now.
    pub sequences: usize,
    /// Success probability of the best order until now.
    pub best: Option<f64>,
}

/// Search for orders of one plan. Caches its results, and shares the cache with its clones.
#[doc(alias = "PGen")]
#[derive(Clone, Debug)]
pub struct OrderSearch {
    model: Arc<Model>,
    settings: SearchSettings,
    separations: Arc<Separations>,
    couplings: Arc<Couplings>,
    symmetry: Arc<Symmetry>,
    bounds: Arc<Bounds>,
    cache: Cache,
    /// Sequence to examine first.
    first: Arc<Vec<NodeId>>,
}

impl OrderSearch {
    /// Creates a search for orders of the model's plan.
    pub fn new(model: impl Into<Arc<Model>>, settings: SearchSettings) -> Self {
        let model = model.into();
        let separations = Separations::of(&model, settings.keeps_interference);
        let couplings = Couplings::of(&model, &separations);
        let bounds = Bounds::of(&model, &separations, &couplings);
        Self {
            couplings: Arc::new(couplings),
            symmetry: Arc::new(Symmetry::of(&model, &separations)),
            model,
            settings,
            separations: Arc::new(separations),
            bounds: Arc::new(bounds),
            cache: Cache::default(),
            first: Arc::default(),
        }
    }

    /// Examines this sequence first in every search, as far as it is possible; for example, the
    /// plan's own order. If a search for a long plan is interrupted, this may be its only result.
    ///
    /// Starts of running actions and timed initials in the past are left out.
    #[must_use]
    pub fn beginning_with(mut self, sequence: Vec<NodeId>) -> Self {
        self.first = Arc::new(sequence);
        // Cached results may be different ones among several equivalent orders.
        self.cache = Cache::default();
        self
    }

    /// Returns the model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Returns the settings.
    pub fn settings(&self) -> &SearchSettings {
        &self.settings
    }

    /// Returns a plan's happenings at their planned times, as an order. Irrelevant timed initials
    /// are left out. Of those after all actions, only those up to the last one that changes a fact
    /// or number of the goal are included. `steps` are in the order of the plan's instances.
    pub fn timed_sequence(&self, steps: &[Step]) -> Vec<NodeId> {
        let is_timed =
            |node: NodeId| matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        let matters = |node: NodeId| self.separations.timed.iter().any(|(own, _)| *own == node);
        let until_goal = &self.separations.timed[..self.separations.timed_until_goal];
        let is_for_goal = |node: NodeId| until_goal.iter().any(|(own, _)| *own == node);
        let mut order = self.timed_happenings(steps);
        order.retain(|&node| !is_timed(node) || matters(node));
        let last = order
            .iter()
            .rposition(|&node| !is_timed(node) || is_for_goal(node));
        order.truncate(last.map_or(0, |last| last + 1));
        order
    }

    /// Returns all happenings at their planned times. At one moment ends come first, and each
    /// happening comes after those that it needs.
    fn timed_happenings(&self, steps: &[Step]) -> Vec<NodeId> {
        let mut order = Vec::new();
        for mut moment in self.model.planned_moments(steps) {
            self.couplings.sort(&self.model, &mut moment);
            order.append(&mut moment);
        }
        order
    }

    /// Returns `true` if happenings of this plan may need each other at one moment.
    pub(crate) fn has_couplings(&self) -> bool {
        !self.couplings.is_empty()
    }

    /// Returns `true` if no timed initial after `now` changes a fact or number of the goal. Before
    /// that, the goal is not reached.
    pub fn is_goal_settled(&self, now: &Rational) -> bool {
        self.separations.is_goal_settled(now)
    }

    /// Returns `true` if timed initials allow an order to end here: it contains the last one that
    /// the goal depends on, and does not end with a later one. `next_timed` is the number of those
    /// that have passed.
    fn may_be_over(&self, next_timed: usize, sequence: &[NodeId]) -> bool {
        let until_goal = self.separations.timed_until_goal;
        let is_timed =
            |node: &NodeId| matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        let ends_with_timed = sequence.last().is_some_and(is_timed);
        next_timed == until_goal || next_timed > until_goal && !ends_with_timed
    }

    /// Returns the order most likely to succeed from here.
    ///
    /// `watch` is called regularly. If it breaks, the best order until then is returned. Of equally
    /// likely orders, a shorter one is preferred, then the one found first. Its starts are
    /// postponed behind ends as described in `search/postponed.rs`, if this does not reduce the
    /// probability.
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn best_order(
        &mut self,
        circumstances: &SearchState,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<SearchResult, TooCoupled> {
        let has_deadlines = self.separations.has_deadlines(&circumstances.now);
        let key = cache::key(&self.model, circumstances, has_deadlines);
        if let Some(known) = self.cache.get(&key) {
            return Ok(SearchResult {
                order: known.order_at(&circumstances.now),
                stop: SearchStop::Complete,
                sequences: 0,
            });
        }
        let found = self.search(circumstances, watch)?;
        if found.stop == SearchStop::Complete {
            let order = found.order.as_ref();
            self.cache.put(key, order, &circumstances.now);
        }
        Ok(found)
    }

    fn search(
        &self,
        circumstances: &SearchState,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<SearchResult, TooCoupled> {
        let model = &*self.model;
        let nothing = |sequences| SearchResult {
            order: None,
            stop: SearchStop::Complete,
            sequences,
        };
        let Some(rooms) = TimeSlacks::new(&self.separations, circumstances) else {
            return Ok(nothing(0));
        };
        let must_work = self.settings.candidates == Candidates::Working;
        let (nominal, works) = Nominal::new(model, circumstances);
        if must_work && !works {
            return Ok(nothing(0));
        }
        let mut run = Run::new(self, circumstances, nominal, rooms, watch)?;
        run.try_sequence(&self.first)?;
        let stop = match run.explore()? {
            ControlFlow::Continue(()) => SearchStop::Complete,
            ControlFlow::Break(()) => SearchStop::Interrupted,
        };
        let (best, sequences) = run.finish();
        let order = match best {
            None => None,
            Some(Best {
                probability,
                sequence,
                joined,
            }) => {
                let sequence = if joined.contains(&true) {
                    sequence
                } else {
                    self.postponed(circumstances, (sequence, probability))?
                };
                let happenings = Happenings {
                    sequence: &sequence,
                    joined: &joined,
                };
                Some(self.order(circumstances, happenings, probability)?)
            }
        };
        Ok(SearchResult {
            order,
            stop,
            sequences,
        })
    }

    /// Returns a given sequence as an order, with its layers and probabilities.
    ///
    /// The search need not be able to find it. If the sequence has no schedule, the order has no
    /// slots.
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn order_of(
        &self,
        circumstances: &SearchState,
        sequence: &[NodeId],
    ) -> Result<TotalOrderPlan, TooCoupled> {
        let joined = self.joined(circumstances, sequence)?;
        let happenings = Happenings {
            sequence,
            joined: &joined,
        };
        let mut network = PrunedNetwork::new(&self.model, circumstances)?;
        network.push_all(happenings)?;
        let probability = network.success_probability()?;
        self.order(circumstances, happenings, probability)
    }

    /// Returns, for each happening of a sequence, `true` if it comes at the same moment as the
    /// previous one: coupled happenings do if they would fail one after the other.
    fn joined(
        &self,
        circumstances: &SearchState,
        sequence: &[NodeId],
    ) -> Result<Vec<bool>, TooCoupled> {
        if self.couplings.is_empty() {
            return Ok(vec![false; sequence.len()]);
        }
        let model = &*self.model;
        let mut network = PrunedNetwork::new(model, circumstances)?;
        let (mut nominal, _) = Nominal::new(model, circumstances);
        for (at, &node) in sequence.iter().enumerate() {
            let next = sequence.get(at + 1);
            let is_coupled = next.is_some_and(|next| self.couplings.are_coupled(node, *next));
            nominal.apply_open(model, model.event(node));
            network.push_open(node)?;
            let is_settled =
                nominal.is_settled(model, network.running()) && network.may_be_settled();
            if !is_coupled || is_settled {
                network.pop();
                network.push(node)?;
                nominal.stays_possible(model, network.running());
            }
        }
        Ok(network.joined())
    }

    /// Returns the order with its layers and its times.
    fn order(
        &self,
        circumstances: &SearchState,
        happenings: Happenings<'_>,
        probability: f64,
    ) -> Result<TotalOrderPlan, TooCoupled> {
        let mut network = PrunedNetwork::new(&self.model, circumstances)?;
        network.push_all(happenings)?;
        let windows = self.windows_of(circumstances, happenings);
        let windows = windows.unwrap_or_default();
        Ok(TotalOrderPlan::new(
            &self.model,
            circumstances,
            &network,
            probability,
            windows,
        ))
    }

    /// Returns the time window of each happening of a sequence that begins now; `None` if the
    /// sequence has no schedule.
    pub fn windows(&self, circumstances: &SearchState, sequence: &[NodeId]) -> Option<Vec<Slot>> {
        self.windows_of(circumstances, sequence.into())
    }

    /// Like [`Self::windows`], with joined happenings. A first one that is joined comes now.
    pub fn windows_of(
        &self,
        circumstances: &SearchState,
        happenings: Happenings<'_>,
    ) -> Option<Vec<Slot>> {
        let Happenings { sequence, joined } = happenings;
        let mut timing = Timing::new(&self.separations, circumstances)?;
        let mut next_timed = self.passed_timed_count(&circumstances.now);
        for (at, &node) in sequence.iter().enumerate() {
            let is_joined = joined.get(at) == Some(&true);
            timing.push(&self.model, (node, is_joined), next_timed)?;
            let is_timed = matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
            next_timed += usize::from(is_timed);
        }
        let slot = |(node, earliest, latest)| Slot {
            node,
            earliest,
            latest,
        };
        Some(timing.windows().into_iter().map(slot).collect())
    }

    /// Returns the number of relevant timed initials that have passed.
    pub(crate) fn passed_timed_count(&self, now: &Rational) -> usize {
        let timed = self.separations.timed.iter();
        timed.take_while(|(_, time)| time <= now).count()
    }

    /// Returns the suffixes of an order from a position on, after `passed` timed initials.
    pub(crate) fn suffixes(&self, order: &TotalOrderPlan, from: usize, passed: usize) -> Suffixes {
        let running = order.layers.last().map_or(&[][..], |layer| &layer.running);
        let sequence = &order.sequence[..];
        Suffixes::of(
            &self.model,
            &self.separations,
            (sequence, from),
            passed,
            running,
        )
    }

    /// Returns the time window of the happening at a position, if the order continues with it: the
    /// first one of [`OrderSearch::windows`], without the others.
    pub(crate) fn first_of(
        &self,
        rests: &Suffixes,
        order: &TotalOrderPlan,
        position: usize,
        circumstances: &SearchState,
    ) -> FirstWindow {
        let sequence = &order.sequence[..];
        rests.first(&self.separations, (sequence, position), circumstances)
    }
}
