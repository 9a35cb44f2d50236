//! Guarantees for failures: how many failed attempts a plan affords, in a box of durations.
//!
//! A durative action may fail up to a number of times. A failed attempt ends at any time up to the
//! upper end of the action's duration, and this is observed. It reverts the effects of its start and
//! changes nothing else (`undone` of world files). After a recovery the action is started again.
//!
//! A plan is *(B, k)-controllable* if one strategy that observes durations and failures only when
//! they occur satisfies the plan's network for all durations in the box B and all failures, at most
//! k in total and at most `retries` of each action. For k = 0, this is dynamic controllability.
//!
//! Constraints of the network that begin or end at the start of an action have to hold for each of
//! its attempts. So the schedule of the last attempts is a schedule of the plan's network. If every
//! schedule in the box is valid ([`Oracle`](crate::Oracle)), so is each execution: up to each
//! failure it is the beginning of an execution without that failure, and a failure leaves no trace.
//! This holds for *retriable* actions ([`retriable`]).
//!
//! - [`Layers`]: the exact decision, if only deadlines bound the times from above.
//! - [`stretched`]: a sufficient condition for any network.
//! - [`with_failures`]: a necessary condition: each single combination of failures.

mod decision;
mod layers;
mod retriable;
mod stretched;

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::Impossible;
use elbowroom_plan::{DecoupledEnvelope, Node, ParametrizedPlan};
use elbowroom_stn::{Constraint, NodeId};

pub use decision::{FaultLimit, FaultVerdict, MAX_FAULTS, decide, fault_limit};
pub use layers::{DeadlineFailure, Layers};
pub use retriable::{NotRetriable, retriable};
pub use stretched::{stretched, with_failures};

/// Action in a network with failures, or another difference that the world decides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attempt {
    /// Start of the (first) attempt.
    pub start: NodeId,
    /// End of the successful attempt.
    pub end: NodeId,
    /// Least duration of the successful attempt.
    pub lower: Rational,
    /// Greatest duration of each attempt; `None` if there is none.
    pub upper: Option<Rational>,
    /// Greatest number of failures.
    pub retries: usize,
}

/// Temporal network of a plan whose actions may fail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultNetwork {
    /// Number of time points; 0 is time zero.
    pub nodes: usize,
    /// The requirements, without those on durations of attempts.
    pub requirements: Vec<Constraint>,
    /// The actions.
    pub attempts: Vec<Attempt>,
    /// Least and greatest time from a failure to the next start.
    pub recovery: [Rational; 2],
    /// Least duration of a failed attempt.
    pub shortest_failure: Rational,
}

impl FaultNetwork {
    /// Returns the network of a plan in a box. `retries` are those of each action instance.
    ///
    /// # Errors
    /// A constraint that cannot be satisfied for all values in the box.
    pub fn new(
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
        retries: &[usize],
        recovery: [Rational; 2],
    ) -> Result<Self, Impossible> {
        let network = plan.uncertain_network(envelope)?.network;
        let retries_at = |start: NodeId| match plan.plan.nodes[start.index()] {
            Node::Start(id) => retries[id.index()],
            _ => 0,
        };
        let mut attempts: Vec<Attempt> = network
            .links()
            .iter()
            .map(|link| Attempt {
                start: link.activation,
                end: link.end,
                lower: link.lower.clone(),
                upper: link.upper.clone(),
                retries: retries_at(link.activation),
            })
            .collect();
        attempts.extend(fixed_durations(plan, &network, &retries_at));
        let mut ends = BTreeMap::new();
        for (index, attempt) in attempts.iter().enumerate() {
            ends.insert((attempt.start, attempt.end), index);
        }
        // A requirement on a duration applies to each attempt. It is dropped if the interval of the
        // duration implies it; otherwise the action has no retries.
        let mut requirements = Vec::new();
        for requirement in network.requirements().constraints() {
            let (from, to) = (requirement.from, requirement.to);
            if let Some(&index) = ends.get(&(from, to)) {
                let upper = attempts[index].upper.as_ref();
                if upper.is_some_and(|upper| *upper <= requirement.bound) {
                    continue;
                }
                attempts[index].retries = 0;
            } else if let Some(&index) = ends.get(&(to, from)) {
                if attempts[index].lower >= -&requirement.bound {
                    continue;
                }
                attempts[index].retries = 0;
            }
            requirements.push(requirement.clone());
        }
        Ok(Self {
            nodes: plan.plan.nodes.len(),
            requirements,
            attempts,
            recovery,
            shortest_failure: Rational::ZERO,
        })
    }

    /// Returns the time of one failed attempt at worst, with its recovery; `None` if there is no
    /// limit.
    fn longest_failure(&self, attempt: &Attempt) -> Option<Rational> {
        attempt
            .upper
            .as_ref()
            .map(|upper| upper + &self.recovery[1])
    }

    /// Returns the attempt that starts at each node, if one does that may be repeated.
    fn retried_at(&self) -> Vec<Option<usize>> {
        let mut at = vec![None; self.nodes];
        for (index, attempt) in self.attempts.iter().enumerate() {
            if attempt.retries > 0 {
                at[attempt.start.index()] = Some(index);
            }
        }
        at
    }
}

/// Returns the actions whose duration is a requirement of exactly one value.
fn fixed_durations<'a>(
    plan: &'a ParametrizedPlan,
    network: &'a elbowroom_stn::uncertain::UncertainNetwork,
    retries_at: &'a impl Fn(NodeId) -> usize,
) -> impl Iterator<Item = Attempt> + 'a {
    let mut bounds: BTreeMap<(NodeId, NodeId), Rational> = BTreeMap::new();
    for own in network.requirements().constraints() {
        let known = bounds.entry((own.from, own.to));
        let known = known.or_insert_with(|| own.bound.clone());
        if own.bound < *known {
            known.clone_from(&own.bound);
        }
    }
    let constraints = plan.plan.constraints.iter();
    let pairs = constraints.filter_map(|constraint| {
        plan.plan.duration_of(constraint)?;
        let ends = (constraint.from, constraint.to);
        Some((
            elbowroom_plan::network_node(ends.0),
            elbowroom_plan::network_node(ends.1),
        ))
    });
    let pairs: std::collections::BTreeSet<_> = pairs.collect();
    pairs.into_iter().filter_map(move |(start, end)| {
        let upper = bounds.get(&(start, end))?;
        let lower = -bounds.get(&(end, start))?;
        (lower == *upper && !network.is_contingent(end)).then(|| Attempt {
            start,
            end,
            lower,
            upper: Some(upper.clone()),
            retries: retries_at(start),
        })
    })
}
