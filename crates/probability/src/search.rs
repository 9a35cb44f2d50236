//! `PGen`: the order of a plan's happenings that is most likely to succeed.
//!
//! Branch and bound over sequences of happenings (paper 2, section 2.2.1), depth first, the most
//! promising happening first. A sequence is given up when
//!
//! - its happenings cannot be done in this order if nothing goes wrong, or succeed with
//!   probability 0;
//! - there is no time for them: durations, their bounds, timed initials and now leave no schedule;
//! - no way to go on can beat the best order found (a sharper bound than the paper's P(A), see
//!   `search/bound.rs`);
//! - another sequence has done the same and stands at least as well (see `search/memo.rs`);
//! - it has a twin with instances that can stand for each other (see `search/symmetry.rs`).
//!
//! Unlike the published code this keeps the best order found, starts from the belief as it is now,
//! and lets actions be done again that were done before.

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
mod room;
mod run;
mod separations;
mod symmetry;
mod timing;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_num::Rational;
use elbowroom_plan::{Node, NodeId};

use crate::circumstances::Circumstances;
use crate::model::Model;
use crate::network::{Happenings, PrunedNetwork, TooCoupled};
use crate::total_order::{Slot, TotalOrderPlan};
use bound::Bounds;
use cache::Cache;
use coupling::Couplings;
pub use lattice::{Lattice, LatticeEdge, LatticeLimits, LatticeNode, TooLarge};
use nominal::Nominal;
use room::Rooms;
pub(crate) use room::{First, Rests};
use run::{Best, Run};
use separations::Separations;
use symmetry::Symmetry;
use timing::Timing;

/// The sequences that count as orders of the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Candidates {
    /// Those that reach the goal if nothing goes wrong, as in the paper.
    #[default]
    Working,
    /// All. An order may then count on a fact to change by itself.
    All,
}

/// Settings of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSettings {
    /// Which sequences count.
    pub candidates: Candidates,
    /// Whether happenings keep the order of the plan's interference links, as in the paper. If
    /// not, conditions and likelihoods alone decide.
    pub keeps_interference: bool,
}

impl Default for SearchSettings {
    /// The paper's.
    fn default() -> Self {
        Self {
            candidates: Candidates::Working,
            keeps_interference: true,
        }
    }
}

/// Work that is counted for each examined sequence, in units of [`elbowroom_num::work`].
const SEQUENCE_WORK: u64 = 5_000;

/// The reason why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchStop {
    /// Nothing is better.
    Complete,
    /// The callback said so; there may be better.
    Interrupted,
}

/// The result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The order most likely to succeed; `None` if no order can.
    pub order: Option<TotalOrderPlan>,
    /// Whether it is proven to be the best.
    pub stop: SearchStop,
    /// The number of sequences looked at; 0 if the answer was known from before.
    pub sequences: usize,
}

/// Progress of a search, for its callback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The number of sequences looked at so far.
    pub sequences: usize,
    /// The success probability of the best order so far.
    pub best: Option<f64>,
}

/// The search for orders of one plan. Keeps what it has found for when it is asked again, and shares
/// that with its clones.
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
    /// Looked at before all others.
    first: Arc<Vec<NodeId>>,
}

impl OrderSearch {
    /// A search for orders of the model's plan.
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

    /// Begins every search with this sequence, as far as it can be done: that of the plan as it is
    /// timed, say. Of a long plan, a search that is cut short may find nothing else.
    ///
    /// Starts of what is under way and timed initials that have passed are left out.
    #[must_use]
    pub fn beginning_with(mut self, sequence: Vec<NodeId>) -> Self {
        self.first = Arc::new(sequence);
        // What was found by a search that began otherwise may be another of several that are alike.
        self.cache = Cache::default();
        self
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Its settings.
    pub fn settings(&self) -> &SearchSettings {
        &self.settings
    }

    /// A plan's happenings as they are timed, as an order: without the timed initials that do not
    /// matter, and of those that come after all actions, with those up to the last that changes
    /// what the goal reads. `steps` are in the order of the plan's instances.
    pub fn as_timed(&self, steps: &[Step]) -> Vec<NodeId> {
        let is_timed =
            |node: NodeId| matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        let matters = |node: NodeId| self.separations.timed.iter().any(|(own, _)| *own == node);
        let until_goal = &self.separations.timed[..self.separations.timed_until_goal];
        let is_for_goal = |node: NodeId| until_goal.iter().any(|(own, _)| *own == node);
        let mut order = self.happenings_as_timed(steps);
        order.retain(|&node| !is_timed(node) || matters(node));
        let last = order
            .iter()
            .rposition(|&node| !is_timed(node) || is_for_goal(node));
        order.truncate(last.map_or(0, |last| last + 1));
        order
    }

    /// All happenings as they are timed. At one moment ends come first, and each comes after those that it needs.
    fn happenings_as_timed(&self, steps: &[Step]) -> Vec<NodeId> {
        let mut order = Vec::new();
        for mut moment in self.model.moments(steps) {
            self.couplings.sort(&self.model, &mut moment);
            order.append(&mut moment);
        }
        order
    }

    /// Returns `true` if happenings of this plan may need each other at one moment.
    pub(crate) fn has_couplings(&self) -> bool {
        !self.couplings.is_empty()
    }

    /// Whether no timed initial after `now` changes what the goal reads. Until then it is not
    /// reached.
    pub fn is_goal_settled(&self, now: &Rational) -> bool {
        self.separations.is_goal_settled(now)
    }

    /// Whether an order may end here as far as timed initials go: with the last one that the goal
    /// depends on behind it, and not with one that nothing comes after. `next_timed` counts those
    /// that have passed.
    fn may_be_over(&self, next_timed: usize, sequence: &[NodeId]) -> bool {
        let until_goal = self.separations.timed_until_goal;
        let is_timed =
            |node: &NodeId| matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        let ends_with_timed = sequence.last().is_some_and(is_timed);
        next_timed == until_goal || next_timed > until_goal && !ends_with_timed
    }

    /// The order most likely to succeed from here.
    ///
    /// `watch` is called now and then; when it breaks, the best order so far is the answer. Of
    /// orders that are equally likely, a shorter one is preferred, then the one found first. Its starts wait for ends
    /// as `search/postponed.rs` describes, where that costs no probability.
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn best_order(
        &mut self,
        circumstances: &Circumstances,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Found, TooCoupled> {
        let has_deadlines = self.separations.has_deadlines(&circumstances.now);
        let key = cache::key(&self.model, circumstances, has_deadlines);
        if let Some(known) = self.cache.get(&key) {
            return Ok(Found {
                order: known.from(&circumstances.now),
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
        circumstances: &Circumstances,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Found, TooCoupled> {
        let model = &*self.model;
        let nothing = |sequences| Found {
            order: None,
            stop: SearchStop::Complete,
            sequences,
        };
        let Some(rooms) = Rooms::new(&self.separations, circumstances) else {
            return Ok(nothing(0));
        };
        let must_work = self.settings.candidates == Candidates::Working;
        let (nominal, works) = Nominal::new(model, circumstances);
        if must_work && !works {
            return Ok(nothing(0));
        }
        let mut run = Run::new(self, circumstances, nominal, rooms, watch)?;
        run.try_first(&self.first)?;
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
        Ok(Found {
            order,
            stop,
            sequences,
        })
    }

    /// A sequence of one's own as an order, with its layers and probabilities.
    ///
    /// It need not be one that the search would find. Where there is no time for it, it has no
    /// slots.
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn order_of(
        &self,
        circumstances: &Circumstances,
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

    /// Of each happening of a sequence, whether it comes at the same moment as the one before it: coupled happenings do
    /// where they would fail one after the other.
    fn joined(
        &self,
        circumstances: &Circumstances,
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

    /// The order with its layers and its times.
    fn order(
        &self,
        circumstances: &Circumstances,
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

    /// The time at which each happening of a sequence may and can be, if it begins now; `None` if
    /// there is no time for the sequence.
    pub fn windows(&self, circumstances: &Circumstances, sequence: &[NodeId]) -> Option<Vec<Slot>> {
        self.windows_of(circumstances, sequence.into())
    }

    /// The same, with happenings that come at the same moment. A first one that is joined comes now.
    pub fn windows_of(
        &self,
        circumstances: &Circumstances,
        happenings: Happenings<'_>,
    ) -> Option<Vec<Slot>> {
        let Happenings { sequence, joined } = happenings;
        let mut timing = Timing::new(&self.separations, circumstances)?;
        let mut next_timed = self.timed_passed(&circumstances.now);
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

    /// How many of the timed initials that matter have passed.
    pub(crate) fn timed_passed(&self, now: &Rational) -> usize {
        let timed = self.separations.timed.iter();
        timed.take_while(|(_, time)| time <= now).count()
    }

    /// The rests of an order from a position on, for so many timed initials to have passed before it.
    pub(crate) fn rests(&self, order: &TotalOrderPlan, from: usize, passed: usize) -> Rests {
        let running = order.layers.last().map_or(&[][..], |layer| &layer.running);
        let sequence = &order.sequence[..];
        Rests::of(
            &self.model,
            &self.separations,
            (sequence, from),
            passed,
            running,
        )
    }

    /// When the happening at a position may be, if the order goes on with it: the first of
    /// [`OrderSearch::windows`], without the others.
    pub(crate) fn first_of(
        &self,
        rests: &Rests,
        order: &TotalOrderPlan,
        position: usize,
        circumstances: &Circumstances,
    ) -> First {
        let sequence = &order.sequence[..];
        rests.first(&self.separations, (sequence, position), circumstances)
    }
}
