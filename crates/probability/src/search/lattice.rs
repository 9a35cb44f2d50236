//! All orders of a short plan at once: [`Lattice`].
//!
//! The sets of happenings that an order can have behind it, ordered by inclusion: a way upwards
//! from nothing is an order. What is behind an order says what can follow and what would be true if
//! nothing went wrong, but not how likely its facts are: that also depends on the way. So each way
//! is looked at, and a set is given the best of those that lead through it.

use std::collections::BTreeMap;

use elbowroom_num::work;
use elbowroom_plan::{Node, NodeId};

use super::nominal::Nominal;
use super::room::Rooms;
use super::{Candidates, OrderSearch, SEQUENCE_WORK};
use crate::circumstances::Circumstances;
use crate::network::{PrunedNetwork, TooCoupled};

/// The orders of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// The sets through which an order leads, smaller ones first; the first is the empty one. Empty
    /// if there is no order.
    pub nodes: Vec<LatticeNode>,
    /// Sorted by the positions of their ends.
    pub edges: Vec<LatticeEdge>,
    /// How many orders there are.
    pub orders: usize,
}

/// A set of happenings that an order can have behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeNode {
    /// The happenings, sorted.
    pub done: Vec<NodeId>,
    /// The greatest P(A ∩ G) of the orders that lead through it.
    pub best: f64,
    /// The greatest P(A ∩ G) of the orders that end here, if any do.
    pub ends: Option<f64>,
}

/// One more happening.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeEdge {
    /// The position of the smaller set.
    pub from: usize,
    /// The position of the larger set.
    pub to: usize,
    /// The happening by which they differ.
    pub node: NodeId,
    /// The greatest P(A ∩ G) of the orders that lead along it.
    pub best: f64,
}

/// How large a lattice may become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatticeLimits {
    /// The number of sets.
    pub nodes: usize,
    /// The number of sequences that are looked at.
    pub sequences: usize,
}

impl Default for LatticeLimits {
    /// Limits that keep a picture legible and the work below a second or two.
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
    /// Too many ways through them.
    #[error("there are more than {0} prefixes of orders to examine")]
    Sequences(usize),
    /// A condition couples too many facts.
    #[error(transparent)]
    Coupled(#[from] TooCoupled),
}

impl OrderSearch {
    /// All orders of the plan from here: those that [`OrderSearch::best_order`] chooses from.
    ///
    /// # Errors
    /// When there are more than the limits allow.
    pub fn lattice(
        &self,
        circumstances: &Circumstances,
        limits: LatticeLimits,
    ) -> Result<Lattice, TooLarge> {
        let nothing = Lattice {
            nodes: Vec::new(),
            edges: Vec::new(),
            orders: 0,
        };
        let Some(rooms) = Rooms::new(&self.separations, circumstances) else {
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
        let mut walk = Walk {
            search: self,
            must_work,
            network: PrunedNetwork::new(model, circumstances)?,
            nominal,
            rooms,
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
        walk.go_on()?;
        Ok(walk.finish())
    }
}

/// A set of happenings: smaller ones come first.
type Set = (usize, Vec<NodeId>);

struct Walk<'s> {
    search: &'s OrderSearch,
    must_work: bool,
    network: PrunedNetwork<'s>,
    nominal: Nominal,
    rooms: Rooms<'s>,
    is_used: Vec<bool>,
    is_placed: Vec<bool>,
    next_timed: usize,
    limits: LatticeLimits,
    sequences: usize,
    orders: usize,
    nodes: BTreeMap<Set, LatticeNode>,
    edges: BTreeMap<(Set, NodeId), f64>,
}

impl Walk<'_> {
    fn set(&self) -> Set {
        let mut done = self.network.sequence().to_vec();
        done.sort_unstable();
        (done.len(), done)
    }

    /// Looks at all orders that begin like the sequence so far; the best of their probabilities.
    fn go_on(&mut self) -> Result<f64, TooLarge> {
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
            if let Some(through) = self.through(node, is_open)? {
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

    /// The probability of the sequence as it stands, if it is an order.
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
            let works = self.nominal.admit(model, &model.goal);
            self.nominal.undo_to(checkpoint);
            if !works {
                return Ok(None);
            }
        }
        let probability = self.network.success_probability()?;
        Ok((probability > 0.0).then_some(probability))
    }

    /// The best of all orders that go on with this happening; `None` if there are none.
    fn through(&mut self, node: NodeId, is_open: bool) -> Result<Option<f64>, TooLarge> {
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
            if works && self.rooms.push(model, (node, is_joined), timed_before) {
                self.mark(node, what, true);
                best = self.go_on()?;
                self.mark(node, what, false);
                self.rooms.pop();
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

    /// The possible next happenings, regardless of time and probabilities.
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
