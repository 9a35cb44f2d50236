//! Strata of mutually dependent derived facts: the strongly connected components of the rules.

use super::rules::Rules;
use crate::ground::{Condition, FactId};

/// Derived facts in strata. Each stratum comes after those that its facts depend on. The facts of
/// one stratum depend on each other.
#[derive(Clone, Debug)]
pub(crate) struct Strata {
    /// Facts, stratum by stratum.
    facts: Vec<FactId>,
    /// End of each stratum in `facts`.
    ends: Vec<usize>,
    /// By position in the task's table: `true` if the fact depends on itself.
    is_recursive: Vec<bool>,
}

impl Strata {
    /// Returns `None` if a derived fact depends on its own negation.
    pub(crate) fn of(rules: &Rules) -> Option<Self> {
        let heads: Vec<FactId> = rules.heads().collect();
        let edges = edges(rules, &heads);
        let components = components(&edges);
        let mut component_of = vec![0; heads.len()];
        for (component, nodes) in components.iter().enumerate() {
            for &node in nodes {
                component_of[node] = component;
            }
        }
        // Heads are sorted.
        let table_size = heads.last().map_or(0, |head| head.index() + 1);
        let mut is_recursive = vec![false; table_size];
        for (from, edges) in edges.iter().enumerate() {
            for edge in edges {
                if component_of[from] == component_of[edge.to] {
                    if edge.is_negative {
                        return None;
                    }
                    is_recursive[heads[from].index()] = true;
                }
            }
        }
        let mut strata = Self {
            facts: Vec::with_capacity(heads.len()),
            ends: Vec::with_capacity(components.len()),
            is_recursive,
        };
        for nodes in components {
            strata.facts.extend(nodes.iter().map(|&node| heads[node]));
            strata.ends.push(strata.facts.len());
        }
        Some(strata)
    }

    /// Returns the facts of each stratum, lower strata first.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[FactId]> {
        let starts = [0].into_iter().chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.facts[start..end])
    }

    /// Returns `true` if the derived fact depends on itself, directly or through others of its
    /// stratum.
    pub(super) fn is_recursive(&self, fact: FactId) -> bool {
        self.is_recursive[fact.index()]
    }

    /// Returns a number above the highest position of a derived fact in the task's table.
    pub(super) fn table_size(&self) -> usize {
        self.is_recursive.len()
    }
}

/// A rule of one head mentions the head at position `to`.
struct Edge {
    to: usize,
    is_negative: bool,
}

fn edges(rules: &Rules, heads: &[FactId]) -> Vec<Vec<Edge>> {
    let edges_of = |&head: &FactId| {
        let mut edges = Vec::new();
        for rule in rules.of(head) {
            visit_signed(&rule.body, true, &mut |fact, is_positive| {
                if let Ok(to) = heads.binary_search(&fact) {
                    edges.push(Edge {
                        to,
                        is_negative: !is_positive,
                    });
                }
            });
        }
        edges
    };
    heads.iter().map(edges_of).collect()
}

/// Calls `visit` for each fact, with `true` if the number of negations around it is even.
fn visit_signed(condition: &Condition, sign: bool, visit: &mut impl FnMut(FactId, bool)) {
    match condition {
        Condition::Fact(fact) => visit(*fact, sign),
        Condition::Compare(..) => {}
        Condition::Not(part) => visit_signed(part, !sign, visit),
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                visit_signed(part, sign, visit);
            }
        }
    }
}

/// Returns the strongly connected components, each after those that its edges lead to.
///
/// Tarjan, "Depth-First Search and Linear Graph Algorithms" (1972), with an explicit stack.
fn components(edges: &[Vec<Edge>]) -> Vec<Vec<usize>> {
    const UNSEEN: usize = usize::MAX;
    let mut components = Vec::new();
    // Time of the first visit of each node, and the earliest visited node known to be reachable
    // from it whose component is still open.
    let mut seen = vec![UNSEEN; edges.len()];
    let mut lowest = vec![UNSEEN; edges.len()];
    let mut is_open = vec![false; edges.len()];
    let mut open = Vec::new();
    let mut clock = 0;
    // Nodes on the current path, with the number of their edges that have been followed.
    let mut path: Vec<(usize, usize)> = Vec::new();
    for root in 0..edges.len() {
        if seen[root] == UNSEEN {
            path.push((root, 0));
        }
        while let Some((node, followed)) = path.pop() {
            if followed == 0 {
                seen[node] = clock;
                lowest[node] = clock;
                clock += 1;
                is_open[node] = true;
                open.push(node);
            } else {
                // Returns from the edge followed last.
                let to = edges[node][followed - 1].to;
                if is_open[to] {
                    lowest[node] = lowest[node].min(lowest[to]);
                }
            }
            if let Some(edge) = edges[node].get(followed) {
                path.push((node, followed + 1));
                if seen[edge.to] == UNSEEN {
                    path.push((edge.to, 0));
                }
            } else if lowest[node] == seen[node] {
                let first = open.iter().rposition(|&other| other == node);
                let component = open.split_off(first.expect("an open node"));
                for &member in &component {
                    is_open[member] = false;
                }
                components.push(component);
            }
        }
    }
    components
}
