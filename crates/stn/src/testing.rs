//! Random networks for property tests, with answers known by construction.

use elbowroom_num::{Delta, Rational};
use proptest::prelude::*;
use proptest::sample::Index;

use crate::{Constraint, Network, NodeId, Schedule, Weight};

/// A network and the schedule it was built around.
pub type GeneratedNetwork<W = Rational> = (Network<W>, Schedule<W>);

/// Generates networks around a hidden schedule, so that they are consistent by construction.
///
/// Some bounds leave no slack, so that rigid parts occur.
pub fn consistent_networks() -> impl Strategy<Value = GeneratedNetwork> {
    consistent(whole_numbers_and_halves())
}

/// Like [`consistent_networks`], with some strict bounds.
pub fn consistent_strict_networks() -> impl Strategy<Value = GeneratedNetwork<Delta>> {
    consistent(whole_numbers_and_halves().prop_map(Delta::from)).prop_flat_map(
        |(network, times)| {
            let count = network.constraints().len();
            prop::collection::vec(any::<bool>(), count).prop_map(move |is_strict| {
                let mut strict = Network::with_nodes(network.node_count());
                for (constraint, is_strict) in network.constraints().iter().zip(is_strict) {
                    let mut constraint = constraint.clone();
                    if is_strict && constraint.slack_in(&times) > Delta::ZERO {
                        constraint.bound = Delta::just_below(constraint.bound.real);
                    }
                    strict.add(constraint);
                }
                (strict, times.clone())
            })
        },
    )
}

/// Generates small networks, many of them inconsistent.
pub fn networks() -> impl Strategy<Value = Network> {
    let edges = prop::collection::vec((any::<Index>(), any::<Index>(), -6..12_i64), 0..30);
    (1..9_usize, edges).prop_map(|(node_count, edges)| {
        let mut network = Network::with_nodes(node_count);
        for (from, to, bound) in edges {
            network.add(Constraint::at_most(
                node(from, node_count),
                node(to, node_count),
                Rational::from(bound),
            ));
        }
        network
    })
}

/// Generates networks around times drawn from `times`; slacks are distances of two such times.
fn consistent<W: Weight + 'static>(
    times: impl Strategy<Value = W>,
) -> impl Strategy<Value = GeneratedNetwork<W>> {
    let times = prop::collection::vec(times, 2..14);
    let ends = (any::<Index>(), any::<Index>());
    let slack = (any::<Index>(), any::<Index>());
    let edges = prop::collection::vec((ends, slack), 0..50);
    (times, edges).prop_map(|(times, edges)| {
        let schedule = Schedule::new(times);
        let mut network = Network::with_nodes(schedule.times().len());
        for ((from, to), (a, b)) in edges {
            let (from, to) = (
                node(from, network.node_count()),
                node(to, network.node_count()),
            );
            let (a, b) = (a.get(schedule.times()), b.get(schedule.times()));
            let slack = a.minus(b).max(W::zero());
            let bound = schedule[to].minus(&schedule[from]).plus(&slack);
            network.add(Constraint::at_most(from, to, bound));
        }
        (network, schedule)
    })
}

fn whole_numbers_and_halves() -> impl Strategy<Value = Rational> {
    (0..20_i64, 1..3_i64).prop_map(|(numerator, denominator)| Rational::new(numerator, denominator))
}

fn node(index: Index, node_count: usize) -> NodeId {
    NodeId::from_index(index.index(node_count))
}
