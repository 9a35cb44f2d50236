//! Optimal value from one initial belief, on the reachable states only: [`value_bounds`].
//!
//! The problem is split into parts that share no changing fact. Each part is explored from its initial
//! states, so that a fact that never changes, and a group of facts of which one is true at any
//! time, add no states. The optimum is the product of the parts' values:
//!
//! - The product of the parts' values never increases in expectation, because a step changes the
//!   state of one part only. So no agent has a greater value.
//! - An agent that completes one part after another has this value. There is no limit on steps, and
//!   completed parts and parts that have not begun do not change.
//!
//! This requires that no fact changes by itself, because such a change follows each step of any
//! part. Otherwise there is one part.
//!
//! A part with too many states is explored up to a limit. Unexplored states count as lost for the
//! lower bound, and as reached goals for the upper bound.

mod graph;
mod parts;

use super::table::check;
use super::{Settings, TabulationError};
use crate::model::Model;
use crate::search_state::SearchState;
use graph::Graph;

/// Bounds on the greatest success probability of any agent; equal if it was computed exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueBounds {
    /// Success probability of some agent.
    pub lower: f64,
    /// No agent has a greater success probability.
    pub upper: f64,
}

impl ValueBounds {
    /// Returns the bounds of a known value.
    pub(super) fn exact(value: f64) -> Self {
        Self {
            lower: value,
            upper: value,
        }
    }

    /// Returns `true` if the value is known.
    pub fn is_exact(&self) -> bool {
        self.lower >= self.upper
    }
}

/// Largest number of facts whose initial value is uncertain.
const MAX_UNCERTAIN: usize = 12;

/// Returns bounds on the optimal value, without a limit on steps. States where the goal is
/// unreachable without further failures are lost. Of `settings`, only the number of running actions
/// and the treatment of over-all conditions count. Initially no action is running.
///
/// About `max_nodes` nodes are explored. If this suffices, the value is exact: it is approximated
/// from below, until no sweep adds more than 1e-12 to any state.
///
/// # Errors
/// When the model has features other than facts, or too many initial facts are uncertain.
pub fn value_bounds(
    model: &Model,
    settings: &Settings,
    initial: &SearchState,
    max_nodes: usize,
) -> Result<ValueBounds, TabulationError> {
    check(model)?;
    let too_many = TabulationError::TooManyStates {
        facts: model.facts().count(),
        actions: model.plan().instances.len(),
    };
    let mut bounds = ValueBounds::exact(1.0);
    let mut remaining = max_nodes;
    let parts = parts::parts(model, initial);
    for (index, part) in parts.iter().enumerate() {
        let weights = initial_facts(model, &part.facts, initial).ok_or(too_many.clone())?;
        let mut graph = Graph::new(model, settings, part);
        let roots: Vec<(u32, f64)> = weights
            .iter()
            .map(|(facts, weight)| (graph.root(facts), *weight))
            .collect();
        let own = graph.bounds(&roots, remaining / (parts.len() - index));
        remaining = remaining.saturating_sub(graph.len());
        bounds.lower *= own.lower;
        bounds.upper *= own.upper;
    }
    Ok(bounds)
}

/// Returns the possible sets of true facts among `facts`, with their probabilities.
fn initial_facts(
    model: &Model,
    facts: &[usize],
    initial: &SearchState,
) -> Option<Vec<(Vec<usize>, f64)>> {
    let belief = |fact: usize| initial.belief.probability(model.facts[fact]);
    let uncertain = facts
        .iter()
        .filter(|fact| parts::is_uncertain(belief(**fact)));
    if uncertain.count() > MAX_UNCERTAIN {
        return None;
    }
    let mut weights = vec![(Vec::new(), 1.0)];
    for &fact in facts {
        let p = belief(fact);
        let split = |(set, weight): (Vec<usize>, f64)| {
            let mut with = set.clone();
            with.push(fact);
            [(with, weight * p), (set, weight * (1.0 - p))]
        };
        weights = weights.into_iter().flat_map(split).collect();
        weights.retain(|(_, weight)| *weight > 0.0);
    }
    Some(weights)
}
