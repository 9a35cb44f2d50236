//! Networks of 10,000 nodes and 30,000 constraints, like those of deordered plans: durations,
//! precedences to nearby nodes, and some deadlines.

use divan::Bencher;
use elbowroom_num::{Delta, Rational};
use elbowroom_stn::{ConsistentNetwork, Constraint, Network, NodeId, Weight};

fn main() {
    divan::main();
}

const NODES: u32 = 10_000;

/// Small linear congruential generator, for the same networks on each run.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((self.0 >> 33) % u64::from(limit)).expect("below a u32")
    }
}

/// Returns a network with `node` at about `node` seconds; times are in thousandths.
fn network<W: Weight>(node_count: u32, thousandths: impl Fn(i64) -> W) -> Network<W> {
    let mut dice = Random(7);
    let mut network = Network::with_nodes(node_count as usize);
    let mut jitter = Random(11);
    let times: Vec<i64> = (0..node_count)
        .map(|node| i64::from(node) * 1000 + i64::from(jitter.below(900)))
        .collect();
    for later in 1..node_count {
        // A precedence.
        let near = later - 1 - dice.below(later.min(20));
        let gap = times[later as usize] - times[near as usize];
        network.add(Constraint::at_least(
            NodeId(near),
            NodeId(later),
            thousandths((gap - i64::from(dice.below(500))).max(1)),
        ));
        // A duration, at most.
        let start = later - 1 - dice.below(later.min(50));
        let length = times[later as usize] - times[start as usize];
        network.add(Constraint::at_most(
            NodeId(start),
            NodeId(later),
            thousandths(length + i64::from(dice.below(2000))),
        ));
        // Any other constraint, mostly loose.
        let other = dice.below(node_count);
        let difference = times[later as usize] - times[other as usize];
        network.add(Constraint::at_most(
            NodeId(other),
            NodeId(later),
            thousandths(difference + i64::from(dice.below(1_000_000))),
        ));
    }
    network
}

fn rational(thousandths: i64) -> Rational {
    Rational::new(thousandths, 1000)
}

fn rationals(node_count: u32) -> Network {
    network(node_count, rational)
}

fn consistent(node_count: u32) -> ConsistentNetwork {
    ConsistentNetwork::try_from(rationals(node_count)).expect("consistent by construction")
}

#[divan::bench]
fn consistency_of_rationals(bencher: Bencher) {
    let network = rationals(NODES);
    bencher.bench(|| network.consistency());
}

#[divan::bench]
fn consistency_of_deltas(bencher: Bencher) {
    let network = network(NODES, |n| Delta::from(rational(n)));
    bencher.bench(|| network.consistency());
}

#[divan::bench]
fn consistency_of_integers(bencher: Bencher) {
    let network = network(NODES, |n| n);
    bencher.bench(|| network.consistency());
}

#[divan::bench]
fn a_negative_cycle_through_everything(bencher: Bencher) {
    let mut network = rationals(NODES);
    network.add(Constraint::at_most(
        NodeId(0),
        NodeId(NODES - 1),
        rational(i64::from(NODES) * 300),
    ));
    assert!(network.consistency().is_err());
    bencher.bench(|| network.consistency());
}

#[divan::bench]
fn windows(bencher: Bencher) {
    let network = consistent(NODES);
    bencher.bench(|| network.windows(NodeId(0)));
}

#[divan::bench]
fn build_one_by_one(bencher: Bencher) {
    let constraints = rationals(NODES);
    bencher.bench(|| {
        let mut network = ConsistentNetwork::new();
        for _ in constraints.nodes() {
            network.add_node();
        }
        for constraint in constraints.constraints() {
            network.add(constraint.clone()).expect("consistent");
        }
        network
    });
}

/// Benchmarks a tightening somewhere in the network, accepted or refused, and its undoing.
#[divan::bench]
fn add_and_undo(bencher: Bencher) {
    let mut network = consistent(NODES);
    let mut dice = Random(13);
    bencher.bench_local(|| {
        let before = network.checkpoint();
        let from = dice.below(NODES - 40);
        let to = from + 1 + dice.below(30);
        let bound = rational(i64::from(to - from) * 1000);
        let outcome = network.add(Constraint::at_most(NodeId(from), NodeId(to), bound));
        network.undo_to(before);
        outcome.is_ok()
    });
}

#[divan::bench]
fn single_distance(bencher: Bencher) {
    let network = consistent(NODES);
    bencher.bench(|| network.distance(NodeId(5000), NodeId(5040)));
}

#[divan::bench(args = [100, 1000, 3000], max_time = 5)]
fn implied(bencher: Bencher, node_count: u32) {
    let network = consistent(node_count);
    bencher.bench(|| network.implied(|_| false));
}

/// Benchmarks a total order given by all its pairs.
#[divan::bench(args = [100, 500])]
fn implied_of_all_pairs(bencher: Bencher, node_count: u32) {
    let mut network = Network::with_nodes(node_count as usize);
    for later in 0..node_count {
        for earlier in 0..later {
            network.add(Constraint::at_least(
                NodeId(earlier),
                NodeId(later),
                rational(1),
            ));
        }
    }
    let network = ConsistentNetwork::try_from(network).expect("an order");
    bencher.bench(|| network.implied(|_| false));
}
