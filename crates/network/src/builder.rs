//! Builder for a network while its file is read.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{BadLink, ContingentLink, LinkId, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId};

use crate::file::{Correlation, Duration, Format, GivenWait, NetworkFile};
use crate::number::Bound;
use crate::report::Report;

/// Network that is being read.
#[derive(Debug)]
pub(crate) struct Builder {
    format: Format,
    pub(crate) name: String,
    pub(crate) reference: Option<NodeId>,
    points: Vec<String>,
    by_name: BTreeMap<String, NodeId>,
    requirements: Network<Rational>,
    links: Vec<ContingentLink<Rational>>,
    durations: Vec<Option<Duration>>,
    /// Positions of the links in the text.
    places: Vec<usize>,
    /// For each node, the link that ends there.
    ending: BTreeMap<NodeId, LinkId>,
    pub(crate) correlations: Vec<Correlation>,
    pub(crate) waits: Vec<GivenWait>,
}

/// Contingent link as given in a file.
#[derive(Debug)]
pub(crate) struct GivenLink {
    pub(crate) at: usize,
    pub(crate) activation: NodeId,
    pub(crate) end: NodeId,
    pub(crate) lower: Bound,
    pub(crate) upper: Bound,
    pub(crate) duration: Option<Duration>,
}

impl Builder {
    pub(crate) fn new(format: Format) -> Self {
        Self {
            format,
            name: String::new(),
            reference: None,
            points: Vec::new(),
            by_name: BTreeMap::new(),
            requirements: Network::new(),
            links: Vec::new(),
            durations: Vec::new(),
            places: Vec::new(),
            ending: BTreeMap::new(),
            correlations: Vec::new(),
            waits: Vec::new(),
        }
    }

    /// Adds a time point.
    pub(crate) fn point(&mut self, name: &str, at: usize, report: &mut Report) {
        if self.by_name.contains_key(name) {
            report.mistake(
                at,
                format!("there are two time points `{name}`"),
                "give each a unique name",
            );
            return;
        }
        let node = self.requirements.add_node();
        self.points.push(name.to_owned());
        self.by_name.insert(name.to_owned(), node);
    }

    /// Returns the time point of that name, if there is one.
    pub(crate) fn find(&self, name: &str) -> Option<NodeId> {
        self.by_name.get(name).copied()
    }

    /// Returns the time point of that name; reports a mistake if there is none.
    pub(crate) fn named(&self, name: &str, at: usize, report: &mut Report) -> Option<NodeId> {
        let node = self.find(name);
        if node.is_none() {
            report.mistake(
                at,
                format!("there is no time point `{name}`"),
                "list it with the others, or correct the name",
            );
        }
        node
    }

    /// Adds the requirement `lower <= to - from <= upper`.
    pub(crate) fn requirement(
        &mut self,
        (from, to): (NodeId, NodeId),
        (lower, upper): (Bound, Bound),
        at: usize,
        report: &mut Report,
    ) {
        match upper {
            Bound::Finite(upper) => {
                self.requirements.add(Constraint::at_most(from, to, upper));
            }
            Bound::Infinity => {}
            Bound::NegativeInfinity => unreachable_bound(at, report),
        }
        match lower {
            Bound::Finite(lower) => {
                self.requirements.add(Constraint::at_least(from, to, lower));
            }
            Bound::NegativeInfinity => {}
            Bound::Infinity => unreachable_bound(at, report),
        }
    }

    /// Adds a contingent link. Returns `None` after reporting a mistake.
    pub(crate) fn link(&mut self, given: GivenLink, report: &mut Report) -> Option<LinkId> {
        let GivenLink {
            at,
            activation,
            end,
            ..
        } = given;
        let begin_name = self.points[activation.index()].clone();
        let end_name = self.points[end.index()].clone();
        let words = format!("the contingent link from `{begin_name}` to `{end_name}`");
        let lower = match given.lower {
            Bound::Finite(lower) if !lower.is_negative() => lower,
            Bound::Finite(_) => {
                report.remark(format!(
                    "{words} has a negative lower bound: 0 is used instead"
                ));
                Rational::ZERO
            }
            Bound::NegativeInfinity => Rational::ZERO,
            Bound::Infinity => {
                unreachable_bound(at, report);
                return None;
            }
        };
        let upper = match given.upper {
            Bound::Infinity => None,
            Bound::Finite(upper) => Some(upper),
            Bound::NegativeInfinity => {
                unreachable_bound(at, report);
                return None;
            }
        };
        if upper.as_ref().is_some_and(|upper| *upper < lower) {
            report.mistake(
                at,
                format!("{words} has a lower bound above its upper bound"),
                "write the smaller number first; durations are not negative",
            );
            return None;
        }
        if activation == end {
            report.mistake(
                at,
                format!("the contingent link from `{begin_name}` ends where it begins"),
                "a link connects two different time points",
            );
            return None;
        }
        let id = LinkId(u32::try_from(self.links.len()).ok()?);
        // The first link keeps the end node, because later lookups find a link by its end.
        if self.ending.contains_key(&end) {
            report.mistake(
                at,
                format!("two contingent links end at `{end_name}`"),
                "give each a different end",
            );
            return None;
        }
        self.ending.insert(end, id);
        self.links.push(ContingentLink {
            activation,
            end,
            lower,
            upper,
        });
        self.durations.push(given.duration);
        self.places.push(at);
        Some(id)
    }

    /// Returns all time points so far, by node.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = NodeId> + use<> {
        self.requirements.nodes()
    }

    /// Returns the link that ends at a node.
    pub(crate) fn link_ending_at(&self, node: NodeId) -> Option<LinkId> {
        self.ending.get(&node).copied()
    }

    /// Returns the link with that identifier.
    pub(crate) fn link_of(&self, id: LinkId) -> &ContingentLink<Rational> {
        &self.links[id.index()]
    }

    /// Returns the distribution of the duration of a link, if it has one.
    pub(crate) fn duration_of(&self, id: LinkId) -> Option<&Duration> {
        self.durations[id.index()].as_ref()
    }

    /// Returns the network, unless there were mistakes.
    pub(crate) fn finish(self, report: &mut Report) -> Option<NetworkFile> {
        if report.is_failed() {
            return None;
        }
        let network = match UncertainNetwork::new(self.requirements, self.links) {
            Ok(network) => network,
            Err(bad) => {
                report.mistake(
                    self.places[place_of(&bad).index()],
                    "this contingent link depends on its own end",
                    "begin each link at a time point before its end",
                );
                return None;
            }
        };
        Some(NetworkFile {
            format: self.format,
            name: self.name,
            points: self.points,
            reference: self.reference,
            network,
            durations: self.durations,
            correlations: self.correlations,
            waits: self.waits,
            remarks: Vec::new(),
        })
    }
}

/// Returns the invalid link. All errors except cycles were reported before.
fn place_of(bad: &BadLink) -> LinkId {
    match bad {
        BadLink::NoSuchNode(id)
        | BadLink::Circular(id)
        | BadLink::Negative(id)
        | BadLink::Empty(id)
        | BadLink::SharedEnd(_, id) => *id,
    }
}

fn unreachable_bound(at: usize, report: &mut Report) {
    report.mistake(
        at,
        "infinite bound with the wrong sign",
        "a lower bound may be -inf and an upper bound inf, not the other way round",
    );
}
