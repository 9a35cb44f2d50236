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
//! - another sequence has done the same and stands at least as well (see `search/memo.rs`).
//!
//! Unlike the published code this keeps the best order found, starts from the belief as it is now,
//! and lets actions be done again that were done before.

mod assignment;
mod bound;
mod cache;
mod memo;
mod nominal;
mod timing;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::circumstances::Circumstances;
use crate::model::Model;
use crate::network::{PrunedNetwork, TooCoupled};
use crate::total_order::TotalOrderPlan;
use bound::{Bounds, Outlook};
use cache::Cache;
use memo::Memo;
use nominal::Nominal;
use timing::{Separations, Timing};

/// Which sequences are orders of the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Candidates {
    /// Those that reach the goal if nothing goes wrong, as in the paper.
    #[default]
    Working,
    /// All. An order may then count on a fact to change by itself.
    All,
}

/// How to search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSettings {
    /// The least separation of interfering happenings (ε).
    pub epsilon: Rational,
    /// Which sequences count.
    pub candidates: Candidates,
    /// Whether happenings keep the order of the plan's interference links, as in the paper. If
    /// not, conditions and likelihoods alone decide.
    pub keeps_interference: bool,
}

impl Default for SearchSettings {
    /// The paper's, with ε one thousandth.
    fn default() -> Self {
        Self {
            epsilon: Rational::new(1, 1000),
            candidates: Candidates::Working,
            keeps_interference: true,
        }
    }
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchStop {
    /// Nothing is better.
    Complete,
    /// The callback said so; there may be better.
    Interrupted,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The order most likely to succeed; `None` if no order can.
    pub order: Option<TotalOrderPlan>,
    /// Whether it is proven to be the best.
    pub stop: SearchStop,
    /// How many sequences were looked at; 0 if the answer was known from before.
    pub sequences: usize,
}

/// What a search tells its callback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// How many sequences were looked at so far.
    pub sequences: usize,
    /// The success probability of the best order so far.
    pub best: Option<f64>,
}

/// The search for orders of one plan. Keeps what it has found for when it is asked again.
#[doc(alias = "PGen")]
#[derive(Clone, Debug)]
pub struct OrderSearch {
    model: Arc<Model>,
    settings: SearchSettings,
    separations: Separations,
    bounds: Bounds,
    cache: Cache,
}

impl OrderSearch {
    /// A search for orders of the model's plan.
    pub fn new(model: impl Into<Arc<Model>>, settings: SearchSettings) -> Self {
        let model = model.into();
        let separations = Separations::of(&model, &settings.epsilon, settings.keeps_interference);
        let bounds = Bounds::of(&model, &separations);
        Self {
            model,
            settings,
            separations,
            bounds,
            cache: Cache::default(),
        }
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// How it searches.
    pub fn settings(&self) -> &SearchSettings {
        &self.settings
    }

    /// The order most likely to succeed from here.
    ///
    /// `watch` is called now and then; when it breaks, the best order so far is the answer. Of
    /// orders that are equally likely, a shorter one is preferred, then the one found first.
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
        let found = self.search(circumstances, has_deadlines, watch)?;
        if found.stop == SearchStop::Complete {
            let order = found.order.as_ref();
            self.cache.put(key, order, &circumstances.now);
        }
        Ok(found)
    }

    fn search(
        &self,
        circumstances: &Circumstances,
        has_deadlines: bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Found, TooCoupled> {
        let model = &*self.model;
        let nothing = |sequences| Found {
            order: None,
            stop: SearchStop::Complete,
            sequences,
        };
        let Some(timing) = Timing::new(&self.separations, circumstances) else {
            return Ok(nothing(0));
        };
        let must_work = self.settings.candidates == Candidates::Working;
        let (nominal, works) = Nominal::new(model, circumstances);
        if must_work && !works {
            return Ok(nothing(0));
        }
        let now = &circumstances.now;
        let next_timed = self.separations.timed.iter();
        let next_timed = next_timed.take_while(|(_, time)| time <= now).count();
        let mut is_used = vec![false; model.plan().instances.len()];
        for running in &circumstances.running {
            is_used[running.instance.index()] = true;
        }
        let mut run = Run {
            search: self,
            model,
            must_work,
            has_deadlines,
            network: PrunedNetwork::new(model, circumstances)?,
            nominal,
            timing,
            is_used,
            is_placed: vec![false; model.plan().nodes.len()],
            next_timed,
            memo: Memo::new(model, &self.separations),
            best: None,
            sequences: 0,
            watch,
        };
        let stop = match run.explore()? {
            ControlFlow::Continue(()) => SearchStop::Complete,
            ControlFlow::Break(()) => SearchStop::Interrupted,
        };
        let (best, sequences) = (run.best.take(), run.sequences);
        let order = match best {
            None => None,
            Some((probability, sequence)) => {
                Some(self.order(circumstances, &sequence, probability)?)
            }
        };
        Ok(Found {
            order,
            stop,
            sequences,
        })
    }

    /// The order with its layers and its times.
    fn order(
        &self,
        circumstances: &Circumstances,
        sequence: &[NodeId],
        probability: f64,
    ) -> Result<TotalOrderPlan, TooCoupled> {
        let mut network = PrunedNetwork::new(&self.model, circumstances)?;
        for &node in sequence {
            network.push(node)?;
        }
        let windows = self.windows(circumstances, sequence).unwrap_or_default();
        Ok(TotalOrderPlan::new(
            &self.model,
            circumstances,
            &network,
            probability,
            windows,
        ))
    }

    /// When each happening of a sequence may and can be, if it begins now; `None` if there is no
    /// time for the sequence.
    pub fn windows(&self, circumstances: &Circumstances, sequence: &[NodeId]) -> Option<Vec<Slot>> {
        let mut timing = Timing::new(&self.separations, circumstances)?;
        let now = &circumstances.now;
        let mut next_timed = self.separations.timed.iter();
        let passed = next_timed.by_ref().take_while(|(_, time)| time <= now);
        let mut next_timed = passed.count();
        for &node in sequence {
            if !timing.push(&self.model, node, next_timed) {
                return None;
            }
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
}

/// When a happening may be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Which one.
    pub node: NodeId,
    /// Not before.
    pub earliest: Rational,
    /// Not after; `None` if as late as one likes.
    pub latest: Option<Rational>,
}

struct Run<'s, 'w> {
    search: &'s OrderSearch,
    model: &'s Model,
    must_work: bool,
    has_deadlines: bool,
    network: PrunedNetwork<'s>,
    nominal: Nominal,
    timing: Timing<'s>,
    is_used: Vec<bool>,
    is_placed: Vec<bool>,
    /// The next of the timed initials that matter.
    next_timed: usize,
    memo: Memo,
    best: Option<(f64, Vec<NodeId>)>,
    sequences: usize,
    watch: &'w mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

/// Two probabilities closer than this, relatively, count as equal.
const TIE: f64 = 1e-12;

impl Run<'_, '_> {
    /// Looks at the sequence so far, and at all that begin with it.
    fn explore(&mut self) -> Result<ControlFlow<()>, TooCoupled> {
        self.sequences += 1;
        let progress = Progress {
            sequences: self.sequences,
            best: self.best.as_ref().map(|(probability, _)| *probability),
        };
        if (self.watch)(&progress).is_break() {
            return Ok(ControlFlow::Break(()));
        }
        self.consider()?;
        let mut promising = Vec::new();
        for node in self.next() {
            if let Some(bound) = self.push(node)? {
                promising.push((bound, node));
                self.pop(node);
            }
        }
        promising.sort_by(|(a, first), (b, second)| b.total_cmp(a).then(first.cmp(second)));
        for (bound, node) in promising {
            if !self.can_beat(bound) {
                continue;
            }
            if self.push(node)?.is_none() {
                continue;
            }
            let deeper = if self.timing.push(self.model, node, self.timed_before(node)) {
                let deeper = if self.is_dominated() {
                    ControlFlow::Continue(())
                } else {
                    self.explore()?
                };
                self.timing.pop();
                deeper
            } else {
                ControlFlow::Continue(())
            };
            self.pop(node);
            if deeper.is_break() {
                return Ok(deeper);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The position among the timed initials that `node` itself has, if it is one.
    fn timed_before(&self, node: NodeId) -> usize {
        let is_timed = matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        self.next_timed - usize::from(is_timed)
    }

    /// Whether something of that probability, or of any up to that bound, could be better than the
    /// best so far.
    fn can_beat(&self, bound: f64) -> bool {
        match &self.best {
            None => bound > 0.0,
            Some((best, order)) => {
                bound > best * (1.0 + TIE)
                    || (bound >= best * (1.0 - TIE) && self.length() < order.len())
            }
        }
    }

    fn length(&self) -> usize {
        self.network.sequence().len() + self.network.running().len()
    }

    /// Keeps the sequence so far, if it is an order and better than the best.
    fn consider(&mut self) -> Result<(), TooCoupled> {
        let last = self.network.sequence().last();
        let is_timed =
            |node: &NodeId| matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        if !self.network.running().is_empty() || last.is_some_and(is_timed) {
            return Ok(());
        }
        if self.must_work {
            let checkpoint = self.nominal.checkpoint();
            let works = self.nominal.admit(self.model, &self.model.goal);
            self.nominal.undo_to(checkpoint);
            if !works {
                return Ok(());
            }
        }
        let probability = self.network.success_probability()?;
        let length = self.network.sequence().len();
        let is_better = match &self.best {
            None => probability > 0.0,
            Some((best, order)) => {
                probability > best * (1.0 + TIE)
                    || (probability >= best * (1.0 - TIE) && length < order.len())
            }
        };
        if is_better {
            self.best = Some((probability, self.network.sequence().to_vec()));
        }
        Ok(())
    }

    /// What could be next, time and probabilities aside.
    fn next(&self) -> Vec<NodeId> {
        let separations = &self.search.separations;
        let mut next = Vec::new();
        for (id, _) in self.model.plan().instances() {
            let (start, end) = (separations.starts[id.index()], separations.ends[id.index()]);
            let node = if !self.is_used[id.index()] {
                start
            } else if start != end && self.network.running().contains(&id) {
                end
            } else {
                continue;
            };
            if separations.may_follow(node, &|other| self.is_placed[other.index()]) {
                next.push(node);
            }
        }
        next.extend(
            separations
                .timed
                .get(self.next_timed)
                .map(|(node, _)| *node),
        );
        next
    }

    /// Adds a happening to everything but the timing; the bound of all that can follow, unless
    /// the happening is impossible or the bound is not good enough.
    fn push(&mut self, node: NodeId) -> Result<Option<f64>, TooCoupled> {
        let model = self.model;
        let event = model.event(node);
        self.memo.mark(self.nominal.checkpoint());
        let what = model.plan().nodes[node.index()];
        self.is_placed[node.index()] = true;
        match what {
            Node::Start(id) | Node::Instant(id) => self.is_used[id.index()] = true,
            Node::Timed(_) => self.next_timed += 1,
            Node::End(_) | Node::Zero => {}
        }
        let pushed = self.network.push(node);
        let probability = match pushed {
            Ok(probability) => probability,
            Err(error) => {
                self.unmark(node);
                return Err(error);
            }
        };
        let works = !self.must_work || self.nominal.apply(model, event, self.network.running());
        let bound = if works && probability > 0.0 {
            self.bound()
        } else {
            0.0
        };
        if self.can_beat(bound) {
            Ok(Some(bound))
        } else {
            self.pop(node);
            Ok(None)
        }
    }

    fn pop(&mut self, node: NodeId) {
        self.network.pop();
        self.unmark(node);
    }

    fn unmark(&mut self, node: NodeId) {
        self.is_placed[node.index()] = false;
        match self.model.plan().nodes[node.index()] {
            Node::Start(id) | Node::Instant(id) => self.is_used[id.index()] = false,
            Node::Timed(_) => self.next_timed -= 1,
            Node::End(_) | Node::Zero => {}
        }
        let checkpoint = self.memo.unmark();
        self.nominal.undo_to(checkpoint);
    }

    fn bound(&mut self) -> f64 {
        let is_used = &self.is_used;
        let is_free = |id: InstanceId| !is_used[id.index()];
        let outlook = Outlook {
            nominal: &self.nominal,
            must_work: self.must_work,
            is_free: &is_free,
            has_timed: self.next_timed < self.search.separations.timed.len(),
        };
        self.search.bounds.bound(
            self.model,
            &mut self.network,
            &outlook,
            &self.search.separations,
        )
    }

    /// Whether a sequence that has done the same stands at least as well.
    fn is_dominated(&mut self) -> bool {
        let has_timed = self.next_timed < self.search.separations.timed.len();
        let room = self.timing.room(self.has_deadlines && has_timed);
        self.memo.is_dominated(
            self.model,
            &self.nominal,
            &mut self.network,
            &self.is_used,
            self.next_timed,
            room,
        )
    }
}
