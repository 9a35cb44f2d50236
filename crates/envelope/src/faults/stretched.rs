//! Networks without failures that are harder or easier than one with failures.

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId};

use super::FaultNetwork;

/// Returns a network whose controllability is *sufficient* for at most `k` failures: each action
/// lasts as long as all its attempts together. `None` if there is no such network.
///
/// A time point after the start of an action that may fail comes after its end, less its least
/// duration. Upper bounds on its start apply to the start less the time of all failures.
pub fn stretched(network: &FaultNetwork, k: usize) -> Option<UncertainNetwork> {
    let retried = network.retried_at();
    let mut requirements = Network::with_nodes(network.nodes);
    for own in &network.requirements {
        let retried = retried[own.to.index()].filter(|_| k > 0);
        let Some(index) = retried else {
            requirements.add(own.clone());
            continue;
        };
        let attempt = &network.attempts[index];
        requirements.add(if own.bound.is_positive() {
            let lost = times(&network.longest_failure(attempt)?, attempt.retries.min(k));
            Constraint::at_most(own.from, own.to, &own.bound - &lost)
        } else {
            Constraint::at_most(own.from, attempt.end, &own.bound + &attempt.lower)
        });
    }
    let links = network.attempts.iter().map(|attempt| {
        let count = attempt.retries.min(k);
        let failures = match count {
            0 => Some(Rational::ZERO),
            _ => network
                .longest_failure(attempt)
                .map(|longest| times(&longest, count)),
        };
        ContingentLink {
            activation: attempt.start,
            end: attempt.end,
            lower: attempt.lower.clone(),
            upper: attempt.upper.as_ref().zip(failures).map(|(u, f)| u + &f),
        }
    });
    UncertainNetwork::new(requirements, links.collect()).ok()
}

/// Returns a network whose controllability is *necessary*: each action fails as often as
/// `failures` says, and the executor knows this in advance. `None` if there is no such network.
pub fn with_failures(network: &FaultNetwork, failures: &[usize]) -> Option<UncertainNetwork> {
    let mut count = network.nodes;
    let mut add_node = || {
        let node = NodeId(u32::try_from(count).ok()?);
        count += 1;
        Some(node)
    };
    let mut last_starts: Vec<NodeId> = (0..network.nodes)
        .map(|node| NodeId(u32::try_from(node).unwrap_or(u32::MAX)))
        .collect();
    let mut links = Vec::new();
    let mut added = Vec::new();
    for (attempt, &failures) in network.attempts.iter().zip(failures) {
        let mut start = attempt.start;
        for _ in 0..failures {
            let (failed, recovered, next) = (add_node()?, add_node()?, add_node()?);
            let shortest = match &attempt.upper {
                Some(upper) if *upper < network.shortest_failure => upper.clone(),
                _ => network.shortest_failure.clone(),
            };
            links.push(ContingentLink {
                activation: start,
                end: failed,
                lower: shortest,
                upper: attempt.upper.clone(),
            });
            links.push(ContingentLink {
                activation: failed,
                end: recovered,
                lower: network.recovery[0].clone(),
                upper: Some(network.recovery[1].clone()),
            });
            added.push(Constraint::at_least(recovered, next, Rational::ZERO));
            start = next;
        }
        if failures > 0 {
            last_starts[attempt.start.index()] = start;
        }
        links.push(ContingentLink {
            activation: start,
            end: attempt.end,
            lower: attempt.lower.clone(),
            upper: attempt.upper.clone(),
        });
    }
    let mut requirements = Network::with_nodes(count);
    for own in &network.requirements {
        // Lower bounds on a start apply to the first attempt, all others to the last one.
        let from = if own.bound.is_positive() {
            last_starts[own.from.index()]
        } else {
            own.from
        };
        let to = last_starts[own.to.index()];
        requirements.add(Constraint::at_most(from, to, own.bound.clone()));
    }
    for own in added {
        requirements.add(own);
    }
    UncertainNetwork::new(requirements, links).ok()
}

fn times(value: &Rational, count: usize) -> Rational {
    value * Rational::from(i64::try_from(count).unwrap_or(i64::MAX))
}
