//! The rules by which a conflict follows from a network, so that it can be checked again with other
//! bounds.

use std::ops::ControlFlow;

use super::dynamic::Search;
use super::graph::{EdgeId, Graph, Kind, Origin, WayId};
use super::{LinkId, UncertainNetwork};
use crate::{ConstraintId, Weight};

/// The limit on the parts of a refutation: what is shared is spelt out each time.
const MOST_PARTS: usize = 10_000;

/// The limit on the parts of all refutations of a network, for each of its nodes.
const MOST_PARTS_A_NODE: usize = 8;

/// One part of a way through the graph of a network, from its beginning to its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// A requirement.
    Requirement(ConstraintId),
    /// The lower-case edge of a link, from activation to end, as long as its lower bound. It may
    /// stand there because what follows it on its way is negative.
    Early(LinkId),
    /// The upper-case edge of a link, from end to activation: minus its upper bound.
    Late(LinkId),
    /// A way that counts as one edge.
    Way(Way),
}

/// Parts one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Way {
    /// Each begins where the one before ends.
    pub parts: Vec<Part>,
    /// The way is a wait for the end of that link, taken for an edge that always holds, because it
    /// is not longer than the link takes at least. Whatever the bounds, an edge of minus the link's
    /// lower bound holds in its place: so the edge's length is the greater of the two.
    pub unlabelled: Option<LinkId>,
}

/// Why a network is not dynamically controllable, rule by rule.
///
/// The cycle of ways is semi-reducible as long as, in each way, what follows a
/// [`Part::Early`] adds up to less than 0; if the cycle does so too, no strategy exists. That is a
/// statement about every network with these requirements and links, whatever their bounds
/// (Morris 2006, Morris & Muscettola 2005).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refutation {
    /// The cycle; each way begins where the one before ends.
    pub cycle: Vec<Way>,
}

/// Refutations, if there are any that are not too long to be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refuted {
    /// The network is dynamically controllable.
    No,
    /// It is not, and each of these is a reason.
    Because(Vec<Refutation>),
    /// It is not, but to say why takes too many words.
    TooLong,
}

impl<W: Weight> UncertainNetwork<W> {
    /// Why the network is not dynamically controllable, rule by rule: as many reasons, at most, as
    /// come up when it is gone through once, and no more than `most`. The first one does not depend
    /// on how many are wanted.
    pub fn refutations(&self, most: usize) -> Refuted {
        let mut graph = Graph::new(self);
        let mut search = Search::new(self, &mut graph, false);
        let mut found = Vec::new();
        let mut is_refuted = false;
        let most_parts = MOST_PARTS.max(MOST_PARTS_A_NODE * self.requirements.node_count());
        let mut all_parts = 0;
        let mut on_cycle = |graph: &Graph<W>, cycle: &[WayId]| {
            is_refuted = true;
            let mut parts = 0;
            let ways = cycle.iter().map(|&way| spelt_out(graph, way, &mut parts));
            found.extend(
                ways.collect::<Option<_>>()
                    .map(|cycle| Refutation { cycle }),
            );
            all_parts += parts + cycle.len();
            if found.len() < most && all_parts < most_parts {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        };
        for node in self.requirements.nodes() {
            if search.settle_all(node, &mut on_cycle).is_break() {
                break;
            }
        }
        match (is_refuted, found.is_empty()) {
            (false, _) => Refuted::No,
            (true, true) => Refuted::TooLong,
            (true, false) => Refuted::Because(found),
        }
    }
}

/// The parts of a way; `None` if there are too many.
fn spelt_out<W: Weight>(graph: &Graph<W>, way: WayId, count: &mut usize) -> Option<Way> {
    let mut parts = Vec::new();
    let mut next = Some(way);
    while let Some(id) = next {
        let way = graph.ways[id];
        parts.push(part(graph, way.edge, count)?);
        next = way.rest;
    }
    Some(Way {
        parts,
        unlabelled: None,
    })
}

fn part<W: Weight>(graph: &Graph<W>, id: EdgeId, count: &mut usize) -> Option<Part> {
    *count += 1;
    if *count > MOST_PARTS {
        return None;
    }
    let edge = &graph.edges[id];
    Some(match (edge.origin, edge.kind) {
        (Origin::Requirement(id), _) => Part::Requirement(id),
        (Origin::Link(link), Kind::Lower(_)) => Part::Early(link),
        (Origin::Link(link), Kind::Upper(_)) => Part::Late(link),
        // A link that takes no time: its end comes at least so much after its activation.
        (Origin::Link(link), Kind::Plain) => Part::Way(Way {
            parts: vec![Part::Late(link)],
            unlabelled: Some(link),
        }),
        (Origin::Way(way), kind) => {
            let mut spelt = spelt_out(graph, way, count)?;
            if kind == Kind::Plain {
                spelt.unlabelled = label(graph, way);
            }
            Part::Way(spelt)
        }
    })
}

/// The link for whose end a way waits.
fn label<W: Weight>(graph: &Graph<W>, way: WayId) -> Option<LinkId> {
    let mut last = graph.ways[way];
    while let Some(rest) = last.rest {
        last = graph.ways[rest];
    }
    match graph.edges[last.edge].kind {
        Kind::Upper(link) => Some(link),
        Kind::Plain | Kind::Lower(_) => None,
    }
}
