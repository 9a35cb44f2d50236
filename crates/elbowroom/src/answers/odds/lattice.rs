//! All orders of a short plan.

use elbowroom_plan::NodeId;
use elbowroom_probability::search::{Lattice, LatticeLimits};
use elbowroom_report::lattice::{LatticePicture, PictureEdge, PictureNode};
use serde::{Deserialize, Serialize};

use super::{OrderAnswer, Subject};

/// All orders, or the reason why they are not listed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LatticeFinding {
    /// All orders.
    Lattice(LatticeAnswer),
    /// The reason why they are not listed.
    Refused(String),
}

/// All orders of a plan, as a lattice: its elements are the sets of happenings that are prefixes of
/// orders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeAnswer {
    /// Number of orders.
    pub orders: usize,
    /// The sets, smaller ones first; the first is empty.
    pub sets: Vec<SetAnswer>,
    /// The happenings that lead from set to set.
    pub edges: Vec<EdgeAnswer>,
    /// The sets along the order of the answer, up to the first one that is not listed.
    pub order: Vec<usize>,
}

/// A set of happenings that is a prefix of an order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetAnswer {
    /// The happenings in words.
    pub happenings: Vec<String>,
    /// The greatest P(A ∩ G) of the orders that lead through it.
    pub best: f64,
    /// The greatest P(A ∩ G) of the orders that end there, if any do.
    pub ends: Option<f64>,
}

/// An edge of the lattice: one more happening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeAnswer {
    /// The position of a set.
    pub from: usize,
    /// The position of a set.
    pub to: usize,
    /// The happening in words.
    pub happening: String,
    /// The greatest P(A ∩ G) of the orders that lead along it.
    pub best: f64,
}

impl LatticeFinding {
    pub(super) fn of(subject: &Subject<'_>, order: &OrderAnswer) -> Self {
        let lattice = subject
            .search
            .lattice(&subject.initial, LatticeLimits::default());
        match lattice {
            Ok(lattice) => Self::Lattice(LatticeAnswer::of(subject, &lattice, order)),
            Err(error) => Self::Refused(error.to_string()),
        }
    }
}

impl LatticeAnswer {
    fn of(subject: &Subject<'_>, lattice: &Lattice, order: &OrderAnswer) -> Self {
        let model = subject.search.model();
        let words = |node: NodeId| model.describe_node(node);
        let mut path = Vec::new();
        for length in 0..=order.sequence.len() {
            let mut done = order.sequence[..length].to_vec();
            done.sort_unstable();
            match lattice.nodes.iter().position(|node| node.done == done) {
                Some(position) => path.push(position),
                None => break,
            }
        }
        Self {
            orders: lattice.orders,
            sets: lattice
                .nodes
                .iter()
                .map(|node| SetAnswer {
                    happenings: node.done.iter().map(|&node| words(node)).collect(),
                    best: node.best,
                    ends: node.ends,
                })
                .collect(),
            edges: lattice
                .edges
                .iter()
                .map(|edge| EdgeAnswer {
                    from: edge.from,
                    to: edge.to,
                    happening: words(edge.node),
                    best: edge.best,
                })
                .collect(),
            order: path,
        }
    }

    /// Returns a picture of the lattice.
    pub fn picture(&self, title: &str) -> LatticePicture {
        let best = self.sets.first().map_or(0.0, |set| set.best);
        let subtitle = format!(
            "{} orders; the best succeeds with probability {best:.4}. A darker node has a better \
             best order; hover for details.",
            self.orders
        );
        LatticePicture {
            title: title.to_owned(),
            subtitle,
            nodes: self
                .sets
                .iter()
                .map(|set| PictureNode {
                    level: set.happenings.len(),
                    words: if set.happenings.is_empty() {
                        "no happening yet".to_owned()
                    } else {
                        set.happenings.join(", ")
                    },
                    value: set.best,
                    is_end: set.ends.is_some(),
                })
                .collect(),
            edges: self
                .edges
                .iter()
                .map(|edge| PictureEdge {
                    from: edge.from,
                    to: edge.to,
                    words: edge.happening.clone(),
                    value: edge.best,
                })
                .collect(),
            shown: self.order.clone(),
        }
    }
}
