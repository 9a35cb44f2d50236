//! Incremental windows, compared with windows computed from scratch.

use elbowroom_num::Rational;
use elbowroom_stn::testing::consistent_networks;
use elbowroom_stn::{
    ConsistentNetwork, Constraint, ConstraintId, IncrementalWindows, Network, NodeId, WindowEnd,
};
use proptest::prelude::*;
use proptest::sample::Index;

/// Kind of limit that a test sets on a node.
#[derive(Clone, Copy, Debug)]
enum Limit {
    Fix,
    NotBefore,
    NotAfter,
}

fn limits() -> impl Strategy<Value = Vec<(Limit, Index, i64)>> {
    let limit = prop_oneof![
        Just(Limit::Fix),
        Just(Limit::NotBefore),
        Just(Limit::NotAfter)
    ];
    prop::collection::vec((limit, any::<Index>(), -25..25_i64), 1..20)
}

/// Computes the result from scratch, with the limit as one or two constraints.
fn expected_windows(
    network: &ConsistentNetwork,
    limit: Limit,
    node: NodeId,
    time: &Rational,
) -> Option<ConsistentNetwork> {
    let origin = NodeId(0);
    let mut network = network.clone();
    if matches!(limit, Limit::Fix | Limit::NotBefore) {
        network
            .add(Constraint::at_least(origin, node, time.clone()))
            .ok()?;
    }
    if matches!(limit, Limit::Fix | Limit::NotAfter) {
        network
            .add(Constraint::at_most(origin, node, time.clone()))
            .ok()?;
    }
    Some(network)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn moving_windows_are_those_of_the_tightened_network(
        (network, _) in consistent_networks(),
        limits in limits(),
    ) {
        let mut plain = ConsistentNetwork::try_from(network).expect("consistent by construction");
        let mut moving = IncrementalWindows::new(plain.clone(), NodeId(0));
        let count = plain.network().node_count();
        for (limit, node, time) in limits {
            let node = NodeId(u32::try_from(node.index(count)).expect("few nodes"));
            let time = Rational::new(time, 2);
            let answer = match limit {
                Limit::Fix => moving.fix(node, &time),
                Limit::NotBefore => moving.not_before(node, &time),
                Limit::NotAfter => moving.not_after(node, &time),
            };
            let tightened = expected_windows(&plain, limit, node, &time);
            prop_assert_eq!(answer.is_ok(), tightened.is_some(), "{:?}", answer);
            if let Err(out) = &answer {
                prop_assert!(out.amount.is_positive());
                prop_assert_eq!(out.node, node);
            }
            plain = tightened.unwrap_or(plain);
            let windows = plain.windows(NodeId(0));
            for (node, window) in windows.iter() {
                prop_assert_eq!(moving.window(node), window, "{:?} after {:?}", node, limit);
            }
            every_end_has_its_grounds(&moving)?;
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Limits and loosened constraints, mixed, give the same result as if they had held from the
    /// beginning.
    #[test]
    fn loosened_windows_are_those_of_the_loosened_network(
        (network, _) in consistent_networks(),
        steps in limits(),
        loosened in prop::collection::vec((any::<Index>(), prop::option::of(0..9_i64)), 1..12),
    ) {
        let origin = NodeId(0);
        let consistent = |network: &Network| ConsistentNetwork::try_from(network.clone());
        let mut plain = network.clone();
        let mut moving = IncrementalWindows::new(consistent(&network).expect("consistent"), origin);
        let mut known = Vec::new();
        let ids: Vec<ConstraintId> = network.constraint_ids().collect();
        let mut lifted = Vec::new();
        for (step, (limit, node, time)) in steps.into_iter().enumerate() {
            let node = NodeId(u32::try_from(node.index(network.node_count())).expect("few nodes"));
            let time = Rational::new(time, 2);
            let answer = match limit {
                Limit::Fix => moving.fix(node, &time),
                Limit::NotBefore => moving.not_before(node, &time),
                Limit::NotAfter => moving.not_after(node, &time),
            };
            if answer.is_ok() {
                known.push((limit, node, time));
            }
            if let (Some((which, by)), false) = (loosened.get(step), ids.is_empty()) {
                let id = ids[which.index(ids.len())];
                let raised = by.map(|by| &plain.constraint(id).bound + Rational::from(by));
                moving.loosen(id, raised.clone());
                match raised {
                    None => lifted.push(id),
                    Some(_) if lifted.contains(&id) => {}
                    Some(raised) => {
                        let mut changed = Network::with_nodes(plain.node_count());
                        for other in plain.constraint_ids() {
                            let mut constraint = plain.constraint(other).clone();
                            if other == id {
                                constraint.bound = raised.clone();
                            }
                            changed.add(constraint);
                        }
                        plain = changed;
                    }
                }
                lifted.sort();
                lifted.dedup();
            }
            let mut rest = consistent(&plain.without(&lifted)).expect("still consistent");
            for (limit, node, time) in &known {
                rest = expected_windows(&rest, *limit, *node, time).expect("it was before");
            }
            for (node, window) in rest.windows(origin).iter() {
                prop_assert_eq!(moving.window(node), window, "{:?} in step {}", node, step);
            }
            every_end_has_its_grounds(&moving)?;
        }
    }
}

/// Checks that the bounds of the explanation's constraints add up from the root's own end to the
/// node's.
fn every_end_has_its_grounds(moving: &IncrementalWindows) -> Result<(), TestCaseError> {
    let bound = |id: &ConstraintId| moving.network().constraint(*id).bound.clone();
    for node in moving.network().nodes() {
        for end in [WindowEnd::Earliest, WindowEnd::Latest] {
            let value = |node| match end {
                WindowEnd::Earliest => moving.window(node).earliest.clone(),
                WindowEnd::Latest => moving.window(node).latest.clone(),
            };
            let grounds = moving.grounds(node, end);
            prop_assert_eq!(grounds.is_some(), value(node).is_some());
            let Some(grounds) = grounds else { continue };
            let sum: Rational = grounds.constraints.iter().map(bound).sum();
            let sum = match end {
                WindowEnd::Earliest => -sum,
                WindowEnd::Latest => sum,
            };
            let root = value(grounds.root).expect("roots have a value");
            prop_assert_eq!(Some(root + sum), value(node));
        }
    }
    Ok(())
}
