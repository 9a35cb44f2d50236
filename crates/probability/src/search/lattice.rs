//! All orders of a short plan at once: [`Lattice`].
//!
//! The nodes are the sets of happenings that an order can have executed, ordered by inclusion. A
//! path upwards from the empty set is an order. The set determines the happenings that can follow
//! and the nominal state, but not the probabilities of facts: these also depend on the path. So
//! each path is examined, and a set gets the best probability of the paths through it.

use std::collections::BTreeMap;

use elbowroom_num::work;
use elbowroom_plan::{Node, NodeId};

use super::nominal::Nominal;
use super::time_slack::TimeSlacks;
use super::{Candidates, OrderSearch, SEQUENCE_WORK};
use crate::network::{PrunedNetwork, TooCoupled};
use crate::search_state::SearchState;

/// Orders of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// Sets on paths of orders, smaller ones first; the first one is the empty set. There are none
    /// if there is no order.
    pub nodes: Vec<LatticeNode>,
    /// Edges, sorted by the positions of their ends.
    pub edges: Vec<LatticeEdge>,
    /// Number of orders.
    pub orders: usize,
}

/// Set of happenings that an order can have executed.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeNode {
    /// Happenings, sorted.
    pub done: Vec<NodeId>,
    /// Greatest P(A ∩ G) of the orders through it.
    pub best: f64,
    /// Greatest P(A ∩ G) of the orders that end here, if there are any.
    pub ends: Option<f64>,
}

/// One more happening.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeEdge {
    /// Position of the smaller set.
    pub from: usize,
    /// Position of the larger set.
    pub to: usize,
    /// The additional happening.
    pub node: NodeId,
    /// Greatest P(A ∩ G) of the orders with this edge.
    pub best: f64,
}

/// Limits on the size of a lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatticeLimits {
    /// Largest number of sets.
    pub nodes: usize,
    /// Largest number of examined sequences.
    pub sequences: usize,
}

impl Default for LatticeLimits {
    /// Returns limits that keep a diagram legible and the computation below one or two seconds.
    fn default() -> Self {
        Self {
            nodes: 300,
            sequences: 500_000,
        }
    }
}

/// There are too many orders.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TooLarge {
    /// Too many sets.
    #[error("the lattice of orders has more than {0} nodes")]
    Nodes(usize),
    /// Too many paths through them.
    #[error("there are more than {0} prefixes of orders to examine")]
    Sequences(usize),
    /// A condition couples too many facts.
    #[error(transparent)]
    Coupled(#[from] TooCoupled),
}

impl OrderSearch {
    /// Returns all orders of the plan from here: those that [`OrderSearch::best_order`] chooses
    /// from.
    ///
    /// # Errors
    /// When there are more than the limits allow.
    pub fn lattice(
        &self,
        circumstances: &SearchState,
        limits: LatticeLimits,
    ) -> Result<Lattice, TooLarge> {
        let nothing = Lattice {
            nodes: Vec::new(),
            edges: Vec::new(),
            orders: 0,
        };
        let Some(rooms) = TimeSlacks::new(&self.separations, circumstances) else {
            return Ok(nothing);
        };
        let (nominal, works) = Nominal::new(&self.model, circumstances);
        let must_work = self.settings.candidates == Candidates::Working;
        if must_work && !works {
            return Ok(nothing);
        }
        let model = &*self.model;
        let mut is_used = vec![false; model.plan().instances.len()];
        for running in &circumstances.running {
            is_used[running.instance.index()] = true;
        }
        let timed = self.separations.timed.iter();
        let mut walk = LatticeBuilder {
            search: self,
            must_work,
            network: PrunedNetwork::new(model, circumstances)?,
            nominal,
            time_slacks: rooms,
            is_used,
            is_placed: vec![false; model.plan().nodes.len()],
            next_timed: timed
                .take_while(|(_, time)| *time <= circumstances.now)
                .count(),
            limits,
            sequences: 0,
            orders: 0,
            nodes: BTreeMap::new(),
            edges: BTreeMap::new(),
        };
        walk.explore()?;
        Ok(walk.finish())
    }
}

/// A set of happenings, preceded by its size, so that smaller ones come first.
type Set = (usize, Vec<NodeId>);

struct LatticeBuilder<'s> {
    search: &'s OrderSearch,
    must_work: bool,
    network: PrunedNetwork<'s>,
    nominal: Nominal,
    time_slacks: TimeSlacks<'s>,
    is_used: Vec<bool>,
    is_placed: Vec<bool>,
    next_timed: usize,
    limits: LatticeLimits,
    sequences: usize,
    orders: usize,
    nodes: BTreeMap<Set, LatticeNode>,
    edges: BTreeMap<(Set, NodeId), f64>,
}

impl LatticeBuilder<'_> {
    fn set(&self) -> Set {
        let mut done = self.network.sequence().to_vec();
        done.sort_unstable();
        (done.len(), done)
    }

    /// Examines all orders that begin with the current sequence, and returns the best of their
    /// probabilities.
    fn explore(&mut self) -> Result<f64, TooLarge> {
        self.sequences += 1;
        work::spend(SEQUENCE_WORK);
        if self.sequences > self.limits.sequences {
            return Err(TooLarge::Sequences(self.limits.sequences));
        }
        let set = self.set();
        let own = self.ends()?;
        let mut best = own.unwrap_or(0.0);
        self.orders += usize::from(own.is_some());
        for (node, is_open) in self.search.joinable(&self.network, self.next()) {
            if let Some(through) = self.explore_after(node, is_open)? {
                let known = self.edges.entry((set.clone(), node)).or_insert(0.0);
                *known = known.max(through);
                best = best.max(through);
            }
        }
        if best > 0.0 {
            let known = self.nodes.entry(set.clone()).or_insert(LatticeNode {
                done: set.1,
                best: 0.0,
                ends: None,
            });
            known.best = known.best.max(best);
            if let Some(own) = own {
                known.ends = Some(known.ends.map_or(own, |other| other.max(own)));
            }
            if self.nodes.len() > self.limits.nodes {
                return Err(TooLarge::Nodes(self.limits.nodes));
            }
        }
        Ok(best)
    }

    /// Returns the probability of the current sequence, if it is an order.
    fn ends(&mut self) -> Result<Option<f64>, TooLarge> {
        let model = &*self.search.model;
        if !self.network.running().is_empty()
            || self.network.is_open()
            || !self
                .search
                .may_be_over(self.next_timed, self.network.sequence())
        {
            return Ok(None);
        }
        if self.must_work {
            let checkpoint = self.nominal.checkpoint();
            let works = self.nominal.assume(model, &model.goal);
            self.nominal.undo_to(checkpoint);
            if !works {
                return Ok(None);
            }
        }
        let probability = self.network.success_probability()?;
        Ok((probability > 0.0).then_some(probability))
    }

    /// Returns the best probability of all orders that continue with this happening; `None` if
    /// there are none.
    fn explore_after(&mut self, node: NodeId, is_open: bool) -> Result<Option<f64>, TooLarge> {
        let model = &*self.search.model;
        let what = model.plan().nodes[node.index()];
        let timed_before = self.next_timed;
        let checkpoint = self.nominal.checkpoint();
        let mut best = 0.0;
        let is_joined = self.network.is_open();
        if self.network.push_as(node, is_open)? > 0.0 {
            let (event, running) = (model.event(node), self.network.running());
            let works = if is_open {
                let works = self.nominal.apply_open(model, event);
                let holds = self.nominal.is_settled(model, running);
                works && !(holds && self.network.may_be_settled())
            } else {
                !self.must_work || self.nominal.apply(model, event, running)
            };
            if works
                && self
                    .time_slacks
                    .push(model, (node, is_joined), timed_before)
            {
                self.mark(node, what, true);
                best = self.explore()?;
                self.mark(node, what, false);
                self.time_slacks.pop();
            }
        }
        self.nominal.undo_to(checkpoint);
        self.network.pop();
        Ok((best > 0.0).then_some(best))
    }

    fn mark(&mut self, node: NodeId, what: Node, is_done: bool) {
        self.is_placed[node.index()] = is_done;
        match what {
            Node::Start(id) | Node::Instant(id) => self.is_used[id.index()] = is_done,
            Node::Timed(_) if is_done => self.next_timed += 1,
            Node::Timed(_) => self.next_timed -= 1,
            Node::End(_) | Node::Zero => {}
        }
    }

    /// Returns the possible next happenings, regardless of time and probabilities.
    fn next(&self) -> Vec<NodeId> {
        let separations = &self.search.separations;
        let mut next = Vec::new();
        for (id, _) in self.search.model.plan().instances() {
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
        let timed = separations.timed.get(self.next_timed);
        next.extend(timed.map(|(node, _)| *node));
        next
    }

    fn finish(self) -> Lattice {
        let places: BTreeMap<&Set, usize> = self.nodes.keys().zip(0..).collect();
        let mut edges = Vec::new();
        for ((set, node), best) in &self.edges {
            let mut after = set.1.clone();
            after.push(*node);
            after.sort_unstable();
            let after = (after.len(), after);
            if let (Some(&from), Some(&to)) = (places.get(set), places.get(&after)) {
                edges.push(LatticeEdge {
                    from,
                    to,
                    node: *node,
                    best: *best,
                });
            }
        }
        edges.sort_by_key(|edge| (edge.from, edge.to));
        Lattice {
            nodes: self.nodes.into_values().collect(),
            edges,
            orders: self.orders,
        }
    }
}
