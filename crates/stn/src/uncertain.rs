//! Temporal networks with differences that are observed, not chosen.
//!
//! In a *simple temporal network with uncertainty* (STNU; Morris, Muscettola & Vidal 2001) the
//! executor does not choose all time points. The end of a [contingent link](ContingentLink) comes
//! between `lower` and `upper` after its activation, and the world decides when. The executor
//! observes the end only when it happens. There are three levels of controllability, each of which
//! implies the next:
//!
//! - *strong* controllability ([`UncertainNetwork::strong`]): times for all other points, fixed
//!   beforehand, satisfy every constraint whatever the world does;
//! - *dynamic* controllability ([`UncertainNetwork::dynamic`]): there is a strategy that satisfies
//!   every constraint and depends only on past observations. It may react at once: a point may
//!   happen at the same time as the observation that it waits for;
//! - *weak* controllability: for every choice of the world there are times that satisfy every
//!   constraint, but the choice may have to be known beforehand.
//!
//! The check of dynamic controllability returns the [`Dispatchable`] form. A [`Dispatcher`]
//! executes it by propagating each event to neighbours only. If the network is not dynamically
//! controllable, a [`Conflict`] is the proof, and a [`Adversary`] chooses durations that make every
//! executor fail.

mod adversary;
mod conflict;
mod dispatchable;
mod dispatcher;
mod dynamic;
mod earliest;
mod extended;
mod graph;
mod integer_network;
mod order;
mod recheck;
mod refutation;
mod strong;

use std::collections::BTreeSet;
use std::fmt;

use elbowroom_num::Rational;

use crate::{Network, NodeId, Weight};

pub use adversary::Adversary;
pub use conflict::{Conflict, Ground, Step};
pub use dispatchable::{Dispatchable, DispatchableEdge, Wait};
pub use dispatcher::{Dispatcher, Missed};
pub use earliest::EarliestStrategy;
pub use extended::Extended;
pub use integer_network::{IntegerNetwork, Unit};
pub use recheck::Recheck;
pub use refutation::{Part, Refutation, RefutationPath, Refuted};
pub use strong::StrongConflict;

/// Contingent link `lower <= end - activation <= upper`; the world chooses the difference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ContingentLink<W = Rational> {
    /// Time point that the difference counts from.
    pub activation: NodeId,
    /// The time point that the world chooses.
    pub end: NodeId,
    /// The least difference; not negative.
    pub lower: W,
    /// The greatest difference; `None` if there is none.
    pub upper: Option<W>,
}

/// Identifier of a contingent link: its position in [`UncertainNetwork::links`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LinkId(pub u32);

impl LinkId {
    /// Returns the link's position in a list of all links.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) fn from_index(index: usize) -> Self {
        Self(u32::try_from(index).expect("networks have fewer than 2^32 links"))
    }
}

/// Error for invalid contingent links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BadLink {
    /// A link names a node that the network does not have.
    NoSuchNode(LinkId),
    /// A link ends where it begins, or links depend on each other in a cycle.
    Circular(LinkId),
    /// The least difference is negative.
    Negative(LinkId),
    /// The least difference is greater than the greatest one.
    Empty(LinkId),
    /// Two links end at the same time point.
    SharedEnd(LinkId, LinkId),
}

impl fmt::Display for BadLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchNode(link) => write!(
                f,
                "contingent link {} names a time point that the network does not have",
                link.0
            ),
            Self::Circular(link) => write!(
                f,
                "contingent link {} depends on its own end: begin it at a time point that happens \
                 before",
                link.0
            ),
            Self::Negative(link) => write!(
                f,
                "contingent link {} may take less than no time: its lower bound must be at least 0",
                link.0
            ),
            Self::Empty(link) => write!(
                f,
                "contingent link {} has a lower bound above its upper bound",
                link.0
            ),
            Self::SharedEnd(one, other) => write!(
                f,
                "contingent links {} and {} end at the same time point: each needs one of its own",
                one.0, other.0
            ),
        }
    }
}

impl std::error::Error for BadLink {}

/// Time points, requirements on their differences, and contingent links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UncertainNetwork<W = Rational> {
    requirements: Network<W>,
    links: Vec<ContingentLink<W>>,
    /// For each node, the link that ends there.
    ending: Vec<Option<LinkId>>,
}

impl<W: Weight> UncertainNetwork<W> {
    /// Creates a network with these requirements and contingent links. The links need not be
    /// repeated as requirements.
    ///
    /// # Errors
    /// If the links are invalid.
    pub fn new(requirements: Network<W>, links: Vec<ContingentLink<W>>) -> Result<Self, BadLink> {
        let mut ending: Vec<Option<LinkId>> = vec![None; requirements.node_count()];
        for (index, link) in links.iter().enumerate() {
            let id = LinkId::from_index(index);
            let count = requirements.node_count();
            if link.activation.index() >= count || link.end.index() >= count {
                return Err(BadLink::NoSuchNode(id));
            }
            if link.activation == link.end {
                return Err(BadLink::Circular(id));
            }
            if link.lower < W::zero() {
                return Err(BadLink::Negative(id));
            }
            if link.upper.as_ref().is_some_and(|upper| link.lower > *upper) {
                return Err(BadLink::Empty(id));
            }
            if let Some(other) = ending[link.end.index()].replace(id) {
                return Err(BadLink::SharedEnd(other, id));
            }
        }
        let network = Self {
            requirements,
            links,
            ending,
        };
        match network.activation_cycle() {
            Some(link) => Err(BadLink::Circular(link)),
            None => Ok(network),
        }
    }

    /// Returns the constraints that have to be satisfied.
    pub fn requirements(&self) -> &Network<W> {
        &self.requirements
    }

    /// Returns the contingent links, indexed by [`LinkId`].
    pub fn links(&self) -> &[ContingentLink<W>] {
        &self.links
    }

    /// Returns the link with that identifier.
    pub fn link(&self, id: LinkId) -> &ContingentLink<W> {
        &self.links[id.index()]
    }

    /// Returns the identifiers of all links.
    pub fn link_ids(&self) -> impl ExactSizeIterator<Item = LinkId> + use<W> {
        (0..self.links.len()).map(LinkId::from_index)
    }

    /// Returns the link that ends at a node; `None` if the executor chooses when the node happens.
    pub fn ending_at(&self, node: NodeId) -> Option<LinkId> {
        self.ending[node.index()]
    }

    /// Returns `true` if the world decides when the node happens.
    pub fn is_contingent(&self, node: NodeId) -> bool {
        self.ending_at(node).is_some()
    }

    /// Returns a link on a cycle of links, where the end of each link activates the next one.
    fn activation_cycle(&self) -> Option<LinkId> {
        let mut is_known = BTreeSet::new();
        for first in self.link_ids() {
            let mut path = BTreeSet::new();
            let mut at = Some(first);
            while let Some(id) = at.filter(|id| !is_known.contains(id)) {
                if !path.insert(id) {
                    return Some(id);
                }
                at = self.ending_at(self.link(id).activation);
            }
            is_known.extend(path);
        }
        None
    }
}
