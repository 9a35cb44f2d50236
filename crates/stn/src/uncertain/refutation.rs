//! Derivation of a conflict from a network, rule by rule, for checks with other bounds.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use super::dynamic::{ClosedCycle, Search};
use super::graph::{EdgeId, Graph, Kind, Origin, PathId};
use super::{Ground, LinkId, UncertainNetwork};
use crate::{ConstraintId, Weight};

/// Limit on the parts of a refutation, or one for each node if the network has more nodes. Shared
/// parts are written out at each occurrence.
const MAX_PARTS: usize = 10_000;

/// The limit on the parts of all refutations of a network, for each of its nodes.
const MAX_PARTS_PER_NODE: usize = 8;

/// Limit on the nesting of paths. Derivations along a long plan can be nested as deeply as the plan
/// is long.
const MAX_DEPTH: usize = 200;

/// One part of a path through the graph of a network, from its beginning to its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// A requirement.
    Requirement(ConstraintId),
    /// Lower-case edge of a link, from activation to end, as long as its lower bound. It may be
    /// used because the parts after it on its path sum up to a negative length.
    Early(LinkId),
    /// The upper-case edge of a link, from end to activation: minus its upper bound.
    Late(LinkId),
    /// A path that counts as one edge.
    Path(RefutationPath),
}

/// Sequence of parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RefutationPath {
    /// The parts; each begins where the previous one ends.
    pub parts: Vec<Part>,
    /// If present, the path is a wait for the end of that link, used as an edge that always holds,
    /// because it is no longer than the link's minimum duration. For all bounds, an edge of minus
    /// the link's lower bound holds instead. So the edge's length is the greater of the two.
    pub unlabelled: Option<LinkId>,
}

/// Proof that a network is not dynamically controllable, rule by rule.
///
/// The cycle of paths is semi-reducible if, in each path, the parts after a [`Part::Early`] add up
/// to less than 0. If the cycle also adds up to less than 0, no strategy exists. That is true of
/// every network with these requirements and links, whatever their bounds (Morris 2006, Morris &
/// Muscettola 2005).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refutation {
    /// The cycle; each path begins where the previous one ends.
    pub cycle: Vec<RefutationPath>,
    /// `true` if the paths are nested so deeply that only their steps are given, as one path. With
    /// other bounds such a refutation proves something only if it contains no link both as
    /// [`Part::Early`] and as [`Part::Late`]. The steps are then a cycle of bounds, and if they add
    /// up to less than 0, there is no schedule for these durations.
    pub is_flat: bool,
}

/// Refutations of a network, except those that are too long.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refuted {
    /// The network is dynamically controllable.
    No,
    /// The network is not dynamically controllable, and each of these is a proof.
    Refutations(Vec<Refutation>),
    /// The network is not dynamically controllable, but all proofs found are too long.
    TooLong,
}

impl<W: Weight> UncertainNetwork<W> {
    /// Returns proofs that the network is not dynamically controllable: at most `most`, and at most
    /// those found in one pass over the network. The first one does not depend on `most`. Of
    /// several cycles that close at one node, those are left out whose links all occur in earlier
    /// ones.
    pub fn refutations(&self, most: usize) -> Refuted {
        let mut graph = Graph::new(self);
        let mut search = Search::new(self, &mut graph, false);
        let mut found = Vec::new();
        let mut is_refuted = false;
        let node_count = self.requirements.node_count();
        let most_parts = MAX_PARTS.max(MAX_PARTS_PER_NODE * node_count);
        let mut all_parts = 0;
        let mut told = UsedEdges {
            edges: BTreeSet::new(),
            most: MAX_PARTS.max(node_count),
        };
        let mut on_cycle = |graph: &Graph<W>, closed: ClosedCycle, cycle: &[PathId]| {
            is_refuted = true;
            if matches!(closed, ClosedCycle::By(_)) && cycle.iter().all(|&way| told.has(graph, way))
            {
                return ControlFlow::Continue(());
            }
            let mut parts = 0;
            let ways = cycle
                .iter()
                .map(|&way| told.expand(graph, way, &mut parts, 0));
            match ways.collect::<Result<_, _>>() {
                Ok(cycle) => found.push(Refutation {
                    cycle,
                    is_flat: false,
                }),
                Err(RefutationLimit::Deep) => {
                    found.extend(told.flat_path(graph, cycle).map(|steps| {
                        parts = steps.parts.len();
                        Refutation {
                            cycle: vec![steps],
                            is_flat: true,
                        }
                    }));
                }
                Err(RefutationLimit::Long) => {}
            }
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
            (true, false) => Refuted::Refutations(found),
        }
    }
}

/// Record of the edges that refutations have used so far.
struct UsedEdges {
    /// The used edges, except requirements.
    edges: BTreeSet<EdgeId>,
    /// The limit on the parts of one refutation.
    most: usize,
}

impl UsedEdges {
    /// Returns `true` if all edges of a path, requirements excepted, have been used before.
    fn has<W: Weight>(&self, graph: &Graph<W>, way: PathId) -> bool {
        let mut edges = path_suffixes(graph, way).map(|way| graph.paths[way].edge());
        edges.all(|id| {
            matches!(graph.edges[id].origin, Origin::Requirement(_)) || self.edges.contains(&id)
        })
    }

    /// Returns the parts of a path.
    fn expand<W: Weight>(
        &mut self,
        graph: &Graph<W>,
        way: PathId,
        count: &mut usize,
        depth: usize,
    ) -> Result<RefutationPath, RefutationLimit> {
        if depth > MAX_DEPTH {
            return Err(RefutationLimit::Deep);
        }
        // Exact capacity, because there are many paths, most of them short.
        let mut parts = Vec::with_capacity(path_suffixes(graph, way).count());
        for way in path_suffixes(graph, way) {
            parts.push(self.part(graph, graph.paths[way].edge(), count, depth)?);
        }
        Ok(RefutationPath {
            parts,
            unlabelled: None,
        })
    }

    fn part<W: Weight>(
        &mut self,
        graph: &Graph<W>,
        id: EdgeId,
        count: &mut usize,
        depth: usize,
    ) -> Result<Part, RefutationLimit> {
        *count += 1;
        if *count > self.most {
            return Err(RefutationLimit::Long);
        }
        let edge = &graph.edges[id];
        if !matches!(edge.origin, Origin::Requirement(_)) {
            self.edges.insert(id);
        }
        Ok(match (edge.origin, edge.kind) {
            (Origin::Requirement(id), _) => Part::Requirement(id),
            (Origin::Link(link), Kind::Lower(_)) => Part::Early(link),
            (Origin::Link(link), Kind::Upper(_)) => Part::Late(link),
            // A link of duration 0: its end comes at least that much after its activation.
            (Origin::Link(link), Kind::Plain) => Part::Path(RefutationPath {
                parts: vec![Part::Late(link)],
                unlabelled: Some(link),
            }),
            (Origin::Path(way), kind) => {
                let mut spelt = self.expand(graph, way, count, depth + 1)?;
                if kind == Kind::Plain {
                    spelt.unlabelled = label(graph, way);
                }
                Part::Path(spelt)
            }
        })
    }

    /// Returns the steps of a cycle as one path; `None` if there are too many.
    fn flat_path<W: Weight>(
        &mut self,
        graph: &Graph<W>,
        cycle: &[PathId],
    ) -> Option<RefutationPath> {
        let mut edges = Vec::new();
        for way in cycle.iter().flat_map(|&way| path_suffixes(graph, way)) {
            let edge = graph.paths[way].edge();
            self.edges.insert(edge);
            if !graph.expand(edge, self.most, &mut edges) {
                return None;
            }
        }
        let part = |id| match graph.step(id).ground {
            Ground::Requirement(id) => Part::Requirement(id),
            Ground::Early(link) => Part::Early(link),
            Ground::Late(link) => Part::Late(link),
        };
        Some(RefutationPath {
            parts: edges.into_iter().map(part).collect(),
            unlabelled: None,
        })
    }
}

/// Reason why a refutation cannot be given part by part.
enum RefutationLimit {
    /// Too many parts.
    Long,
    /// Nested too deeply.
    Deep,
}

/// Returns a path, its remainder after the first edge, and so on.
fn path_suffixes<W>(graph: &Graph<W>, way: PathId) -> impl Iterator<Item = PathId> + '_ {
    std::iter::successors(Some(way), |&way| graph.paths[way].rest())
}

/// Returns the link whose end a path waits for.
fn label<W: Weight>(graph: &Graph<W>, way: PathId) -> Option<LinkId> {
    let last = path_suffixes(graph, way).last()?;
    match graph.edges[graph.paths[last].edge()].kind {
        Kind::Upper(link) => Some(link),
        Kind::Plain | Kind::Lower(_) => None,
    }
}
