//! Adversary that makes every executor fail if a network is not dynamically controllable.

use std::collections::BTreeSet;

use elbowroom_num::{Delta, Rational};

use super::{ContingentLink, LinkId, UncertainNetwork};
use crate::{Constraint, Network, NodeId, Weight};

/// Number of parts per unit in the integer representation of times.
const PARTS_PER_UNIT: i128 = 1 << 40;

/// Adversary that chooses when links end, so that the executor fails whenever that can be forced.
///
/// If a network is not dynamically controllable, no executor can guarantee success. After any
/// prefix of an execution, the executor can be made to fail either by ending a link now or by
/// continuing it. The adversary decides between the two each time that something has happened or
/// could happen. It does not know the executor's next decisions.
#[derive(Clone, Debug)]
pub struct Adversary {
    network: UncertainNetwork,
    origin: NodeId,
}

impl Adversary {
    /// Creates an adversary for a network whose times are relative to `origin`.
    pub fn new(network: UncertainNetwork, origin: NodeId) -> Self {
        Self { network, origin }
    }

    /// Returns the network.
    pub fn network(&self) -> &UncertainNetwork {
        &self.network
    }

    /// Returns the links that end now, in order. `happened` has the times of past events, by node,
    /// counted from the origin.
    pub fn ends_now(&self, now: &Rational, happened: &[Option<Rational>]) -> Vec<LinkId> {
        let mut happened = happened.to_vec();
        let mut ending = Vec::new();
        let mut later = BTreeSet::new();
        // The end of one link may activate another one with duration 0.
        while let Some(id) = self.next_candidate(now, &happened, &later) {
            let link = self.network.link(id);
            let begun = running_since(link, &happened);
            let is_over = begun
                .zip(link.upper.as_ref())
                .is_some_and(|(begun, upper)| begun + upper <= *now);
            let mut ended = happened.clone();
            ended[link.end.index()] = Some(now.clone());
            if is_over || self.is_lost(now, &ended, &later) {
                happened = ended;
                ending.push(id);
            } else {
                later.insert(id);
            }
        }
        ending
    }

    /// Returns a link that may end now, unless it is in `later`.
    fn next_candidate(
        &self,
        now: &Rational,
        happened: &[Option<Rational>],
        later: &BTreeSet<LinkId>,
    ) -> Option<LinkId> {
        let may_end = |id: &LinkId| {
            let link = self.network.link(*id);
            let begun = running_since(link, happened);
            begun.is_some_and(|begun| begun + &link.lower <= *now)
        };
        let mut links = self.network.link_ids().filter(|id| !later.contains(id));
        links.find(may_end)
    }

    /// Returns the time of the next query if nothing happens before.
    pub fn next_query_time(
        &self,
        now: &Rational,
        happened: &[Option<Rational>],
    ) -> Option<Rational> {
        let links = self.network.links().iter();
        let looks = links.flat_map(|link| {
            let begun = running_since(link, happened);
            let bounds = [Some(&link.lower), link.upper.as_ref()];
            bounds.map(|bound| Some(begun.as_ref()? + bound?))
        });
        looks.flatten().filter(|look| look > now).min()
    }

    /// Returns `true` if no executor can guarantee success any more, provided that these links do
    /// not end now.
    fn is_lost(
        &self,
        now: &Rational,
        happened: &[Option<Rational>],
        later: &BTreeSet<LinkId>,
    ) -> bool {
        let times = happened.iter().flatten().chain([now]);
        if let Some(unit) = self.network.unit_with(times) {
            // A strict bound is less by a part of a unit that is so small that all of them together
            // do not add up to a unit.
            let whole = |number: &Delta| {
                let (infinitesimal, _) = number.infinitesimal.as_small()?;
                let real = unit.to_integer(&number.real)?;
                Some(i128::from(real) * PARTS_PER_UNIT + i128::from(infinitesimal))
            };
            if let Some(is_lost) = self.is_lost_in(now, happened, later, &whole) {
                return is_lost;
            }
        }
        let exact = |number: &Delta| Some(number.clone());
        self.is_lost_in(now, happened, later, &exact)
            .unwrap_or(true)
    }

    /// Computes [`is_lost`](Self::is_lost) with another number type; `None` if some number cannot
    /// be represented in it.
    fn is_lost_in<W: Weight>(
        &self,
        now: &Rational,
        happened: &[Option<Rational>],
        later: &BTreeSet<LinkId>,
        number: &dyn Fn(&Delta) -> Option<W>,
    ) -> Option<bool> {
        match self.remaining_network(now, happened, later, number)? {
            RemainingNetwork::Lost => Some(true),
            RemainingNetwork::Network(rest) => Some(!rest.is_dynamically_controllable()),
        }
    }

    /// Returns the network with past events fixed and all others not before now, or after now.
    /// `None` if some number cannot be represented.
    fn remaining_network<W: Weight>(
        &self,
        now: &Rational,
        happened: &[Option<Rational>],
        later: &BTreeSet<LinkId>,
        number: &dyn Fn(&Delta) -> Option<W>,
    ) -> Option<RemainingNetwork<W>> {
        let given = self.network.requirements();
        let time = |node: NodeId| {
            let is_origin = node == self.origin;
            let zero = is_origin.then_some(Rational::ZERO);
            zero.or_else(|| happened[node.index()].clone())
        };
        let mut requirements = Network::with_nodes(given.node_count());
        for constraint in given.constraints() {
            if let (Some(from), Some(to)) = (time(constraint.from), time(constraint.to)) {
                if to - from > constraint.bound {
                    return Some(RemainingNetwork::Lost);
                }
                continue;
            }
            let bound = number(&Delta::from(constraint.bound.clone()))?;
            requirements.add(Constraint::at_most(constraint.from, constraint.to, bound));
        }
        for node in given.nodes().filter(|&node| node != self.origin) {
            if let Some(time) = &happened[node.index()] {
                let time = number(&Delta::from(time.clone()))?;
                requirements.add(Constraint::at_least(self.origin, node, time.clone()));
                requirements.add(Constraint::at_most(self.origin, node, time));
            } else if !self.network.is_contingent(node) {
                let now = number(&Delta::from(now.clone()))?;
                requirements.add(Constraint::at_least(self.origin, node, now));
            }
        }
        let mut links = Vec::new();
        for id in self.network.link_ids() {
            let link = self.network.link(id);
            if happened[link.end.index()].is_some() {
                continue;
            }
            let mut lower = Delta::from(link.lower.clone());
            let upper = link.upper.clone().map(Delta::from);
            if let Some(begun) = &happened[link.activation.index()] {
                let elapsed = now - begun;
                lower = lower.max(if later.contains(&id) {
                    Delta::just_above(elapsed)
                } else {
                    Delta::from(elapsed)
                });
            }
            if upper.as_ref().is_some_and(|upper| lower > *upper) {
                return Some(RemainingNetwork::Lost);
            }
            let upper = match &upper {
                Some(upper) => Some(number(upper)?),
                None => None,
            };
            links.push(ContingentLink {
                activation: link.activation,
                end: link.end,
                lower: number(&lower)?,
                upper,
            });
        }
        let network = UncertainNetwork::new(requirements, links);
        Some(network.map_or(RemainingNetwork::Lost, RemainingNetwork::Network))
    }
}

/// The remaining part of a network.
enum RemainingNetwork<W> {
    /// Some past event violates a requirement.
    Lost,
    Network(UncertainNetwork<W>),
}

/// Returns the activation time of a running link.
fn running_since(link: &ContingentLink, happened: &[Option<Rational>]) -> Option<Rational> {
    let is_over = happened[link.end.index()].is_some();
    happened[link.activation.index()]
        .clone()
        .filter(|_| !is_over)
}
