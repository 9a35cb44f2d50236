//! Graph of the reachable states of a part, and bounds on the value of its roots.

mod expansion;
mod sweeps;

use indexmap::IndexSet;

use super::ValueBounds;
use super::parts::Part;
use crate::model::Model;
use crate::optimum::Settings;
use expansion::Expansion;

/// Bits of the true facts, then of the running actions.
type Bits = Box<[u64]>;

/// Stage of a node where the agent chooses. At a lower stage, the facts from this position on in
/// the list of spontaneous changes have yet to be drawn.
const CHOICE: u32 = u32::MAX;

/// A state at a stage of a step.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Key {
    bits: Bits,
    stage: u32,
}

/// A choice of the agent, or the random draw of a stage.
#[derive(Clone, Copy, Debug)]
struct Branch {
    /// Positions of its first edge and of the edge after its last one.
    edges: (u32, u32),
    /// The node after it if nothing fails.
    nominal: u32,
}

/// State of knowledge about a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Node {
    /// Its branches are unknown.
    Open,
    /// The goal holds, and no action is running.
    Goal,
    /// Positions of its first branch and of the branch after its last one.
    Expanded(u32, u32),
}

/// Nodes, branches and edges that are known so far.
#[derive(Debug)]
pub(super) struct Graph<'m> {
    expansion: Expansion<'m>,
    keys: IndexSet<Key>,
    nodes: Vec<Node>,
    branches: Vec<Branch>,
    /// Target and probability.
    edges: Vec<(u32, f64)>,
}

/// Difference of the bounds at which the exploration stops.
const ENOUGH: f64 = 1e-4;

/// Largest number of times that the likeliest open nodes are expanded.
const MAX_ROUNDS: usize = 4;

/// Largest number of edges per node of the limit.
const EDGES_PER_NODE: usize = 8;

impl<'m> Graph<'m> {
    pub(super) fn new(model: &'m Model, settings: &'m Settings, part: &'m Part) -> Self {
        Self {
            expansion: Expansion::new(model, settings, part),
            keys: IndexSet::new(),
            nodes: Vec::new(),
            branches: Vec::new(),
            edges: Vec::new(),
        }
    }

    /// Returns the number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Adds the node where these facts are true and no action is running.
    pub(super) fn root(&mut self, facts: &[usize]) -> u32 {
        let bits = self.expansion.bits(facts);
        self.node(bits, CHOICE)
    }

    fn node(&mut self, bits: Bits, stage: u32) -> u32 {
        let (index, is_new) = self.keys.insert_full(Key { bits, stage });
        if is_new {
            self.nodes.push(Node::Open);
        }
        number(index)
    }

    /// Explores the graph until the bounds on the weighted value of the roots are close, or there
    /// are `max_nodes` nodes. First in the order of discovery, then where an optimistic agent is
    /// most likely to go.
    pub(super) fn bounds(&mut self, roots: &[(u32, f64)], max_nodes: usize) -> ValueBounds {
        let is_complete = self.expand_all(max_nodes / 2);
        let value = |values: &[f64]| -> f64 {
            let weighted = roots.iter();
            weighted
                .map(|(root, weight)| values[*root as usize] * weight)
                .sum()
        };
        let mut rounds = 0;
        loop {
            let pessimistic = self.values(false);
            let lower = value(&pessimistic.values);
            let is_complete = is_complete || !self.nodes.contains(&Node::Open);
            if is_complete && pessimistic.has_converged {
                return ValueBounds::exact(lower);
            }
            let optimistic = self.values(true);
            let upper = if optimistic.has_converged {
                value(&optimistic.values).clamp(lower, 1.0)
            } else {
                1.0
            };
            let bounds = ValueBounds { lower, upper };
            rounds += 1;
            let is_over = self.is_full(max_nodes) || rounds > MAX_ROUNDS;
            if is_over || !optimistic.has_converged || upper - lower <= ENOUGH {
                return bounds;
            }
            let wanted = self.likely_open_nodes(roots, &optimistic.values);
            if wanted.is_empty() {
                return bounds;
            }
            let count = (self.len() / 8).max(1);
            for node in wanted.into_iter().take(count) {
                if self.is_full(max_nodes) {
                    break;
                }
                self.expand(node);
            }
        }
    }

    fn is_full(&self, max_nodes: usize) -> bool {
        self.len() >= max_nodes || self.edges.len() >= max_nodes.saturating_mul(EDGES_PER_NODE)
    }

    /// Expands nodes in the order of discovery. Returns `true` if all nodes are expanded.
    fn expand_all(&mut self, max_nodes: usize) -> bool {
        let mut next = 0;
        while next < self.len() {
            if self.is_full(max_nodes) {
                return false;
            }
            self.expand(number(next));
            next += 1;
        }
        true
    }
}

fn number(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}
