//! Small networks with their expected results.

use elbowroom_num::{Delta, Rational};
use elbowroom_stn::{ConsistentNetwork, Constraint, ConstraintId, Network, NodeId};

const A: NodeId = NodeId(0);
const B: NodeId = NodeId(1);
const C: NodeId = NodeId(2);

fn number(value: i64) -> Rational {
    Rational::from(value)
}

fn between(network: &mut Network, from: NodeId, to: NodeId, lower: i64, upper: i64) {
    network.add(Constraint::at_least(from, to, number(lower)));
    network.add(Constraint::at_most(from, to, number(upper)));
}

fn proven(network: Network) -> ConsistentNetwork {
    ConsistentNetwork::try_from(network).expect("consistent")
}

#[test]
fn windows_add_up_along_a_chain() {
    let mut network = Network::with_nodes(3);
    between(&mut network, A, B, 1, 2);
    between(&mut network, B, C, 10, 20);
    let windows = proven(network).windows(A);
    assert_eq!(windows[C].earliest, Some(number(11)));
    assert_eq!(windows[C].latest, Some(number(22)));
    assert_eq!(windows[A].latest, Some(number(0)));
}

#[test]
fn a_node_without_constraints_may_happen_at_any_time() {
    let windows = proven(Network::with_nodes(2)).windows(A);
    assert_eq!(windows[B].earliest, None);
    assert_eq!(windows[B].latest, None);
}

#[test]
fn a_deadline_that_is_too_early_is_refused_with_the_constraints_it_contradicts() {
    let mut network = Network::with_nodes(3);
    between(&mut network, A, B, 4, 9);
    between(&mut network, B, C, 5, 9);
    let mut network = proven(network);
    let refused = network.add(Constraint::at_most(A, C, number(8)));
    let cycle = refused.expect_err("4 + 5 > 8");
    assert_eq!(
        cycle.constraints,
        [ConstraintId(4), ConstraintId(2), ConstraintId(0)]
    );
    assert_eq!(cycle.total, number(-1));
    assert!(network.add(Constraint::at_most(A, C, number(9))).is_ok());
}

#[test]
fn a_strict_bound_is_not_met_by_its_number() {
    let mut network = ConsistentNetwork::<Delta>::new();
    let (a, b) = (network.add_node(), network.add_node());
    let five = || Delta::from(number(5));
    network
        .add(Constraint::at_least(a, b, five()))
        .expect("alone");
    let strict = Constraint::at_most(a, b, Delta::just_below(number(5)));
    let cycle = network.add(strict).expect_err("5 <= d < 5");
    assert_eq!(
        cycle.total,
        &Delta::ZERO - &Delta::just_above(Rational::ZERO)
    );
    assert!(network.add(Constraint::at_most(a, b, five())).is_ok());
}

#[test]
fn a_negative_loop_at_one_node_is_a_contradiction() {
    let mut network = Network::with_nodes(1);
    network.add(Constraint::at_most(A, A, number(-1)));
    let cycle = network.consistency().expect_err("0 <= -1");
    assert_eq!(cycle.constraints, [ConstraintId(0)]);
    let mut network = proven(Network::with_nodes(1));
    assert!(network.add(Constraint::at_most(A, A, number(-1))).is_err());
    assert!(network.add(Constraint::at_most(A, A, number(0))).is_ok());
}

#[test]
fn oldest_of_equal_constraints_is_kept() {
    let mut network = Network::with_nodes(2);
    for _ in 0..3 {
        network.add(Constraint::at_most(A, B, number(7)));
    }
    assert_eq!(
        proven(network).implied(|_| false),
        [ConstraintId(1), ConstraintId(2)]
    );
}

#[test]
fn precedence_through_third_node_is_implied() {
    let mut network = Network::with_nodes(3);
    network.add(Constraint::at_least(A, C, number(2)));
    network.add(Constraint::at_least(A, B, number(1)));
    network.add(Constraint::at_least(B, C, number(1)));
    let network = proven(network);
    assert_eq!(network.implied(|_| false), [ConstraintId(0)]);
    assert!(network.implied(|id| id == ConstraintId(0)).is_empty());
}

#[test]
fn three_nodes_at_fixed_distances_need_four_constraints_at_most() {
    let mut network = Network::with_nodes(3);
    between(&mut network, A, B, 1, 1);
    between(&mut network, B, C, 2, 2);
    between(&mut network, A, C, 3, 3);
    let network = proven(network);
    let implied = network.implied(|_| false);
    let rest = network.network().without(&implied);
    assert_eq!(proven(rest).windows(A), network.windows(A));
    assert_eq!(implied, [ConstraintId(4), ConstraintId(5)]);
}
