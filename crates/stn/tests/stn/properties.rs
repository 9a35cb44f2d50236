//! Every result compared with a simple Bellman-Ford implementation, or checked by its own
//! certificate.

use crate::oracle;
use elbowroom_num::{Delta, Rational};
use elbowroom_stn::testing::{consistent_networks, consistent_strict_networks, networks};
use elbowroom_stn::{ConsistentNetwork, Constraint, ConstraintId, Network, NodeId, Weight};
use proptest::prelude::*;
use proptest::test_runner::TestCaseResult;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn a_network_around_a_schedule_is_consistent((network, hidden) in consistent_networks()) {
        prop_assert!(hidden.holds_in(&network));
        let found = network.consistency().expect("consistent by construction");
        prop_assert!(found.holds_in(&network));
    }

    #[test]
    fn strict_bounds_hold_strictly((network, hidden) in consistent_strict_networks()) {
        prop_assert!(hidden.holds_in(&network));
        let found = network.consistency().expect("consistent by construction");
        for constraint in network.constraints() {
            if constraint.bound.infinitesimal.is_negative() {
                prop_assert!(constraint.slack_in(&found) >= Delta::ZERO);
                let difference = &found[constraint.to] - &found[constraint.from];
                prop_assert!(difference < Delta::from(constraint.bound.real.clone()));
            }
        }
        agrees_with_the_oracle(&network)?;
    }

    #[test]
    fn verdict_and_distances_equal_bellman_ford(network in networks()) {
        agrees_with_the_oracle(&network)?;
    }

    #[test]
    fn components_match_reachability(network in networks()) {
        let components = network.components();
        let leads = |from: NodeId, to: NodeId| {
            let mut seen = vec![false; network.node_count()];
            let mut open = vec![from];
            while let Some(node) = open.pop() {
                if !std::mem::replace(&mut seen[node.index()], true) {
                    open.extend(network.leaving(node).map(|id| network.constraint(id).to));
                }
            }
            seen[to.index()]
        };
        for from in network.nodes() {
            for to in network.nodes() {
                let [own, other] = [from, to].map(|node: NodeId| components[node.index()]);
                prop_assert_eq!(own == other, leads(from, to) && leads(to, from));
                prop_assert!(own <= other || !leads(from, to));
            }
        }
    }

    #[test]
    fn distances_in_consistent_networks_are_right((network, _) in consistent_networks()) {
        agrees_with_the_oracle(&network)?;
    }

    #[test]
    fn paths_add_up_to_the_distances_they_explain((network, _) in consistent_networks()) {
        let network = ConsistentNetwork::try_from(network).expect("consistent by construction");
        for root in network.network().nodes() {
            let (from, to) = (network.shortest_paths_from(root), network.shortest_paths_to(root));
            for node in network.network().nodes() {
                leads(&network, from.path(node).as_deref(), (root, node), from.distance(node))?;
                leads(&network, to.path(node).as_deref(), (node, root), to.distance(node))?;
                let single = network.distance(root, node);
                leads(&network, network.shortest_path(root, node).as_deref(), (root, node), single.as_ref())?;
            }
        }
    }

    #[test]
    fn extreme_schedules_hold_and_touch_both_ends_of_the_windows(
        (network, _) in consistent_networks(),
    ) {
        let network = ConsistentNetwork::try_from(network).expect("consistent by construction");
        for origin in network.network().nodes() {
            let windows = network.windows(origin);
            let (early, late) = (network.earliest_schedule(origin), network.latest_schedule(origin));
            prop_assert!(early.holds_in(network.network()));
            prop_assert!(late.holds_in(network.network()));
            prop_assert_eq!(&early[origin], &Rational::ZERO);
            prop_assert_eq!(&late[origin], &Rational::ZERO);
            for (node, window) in windows.iter() {
                prop_assert!(window.earliest.as_ref().is_none_or(|time| *time == early[node]));
                prop_assert!(window.latest.as_ref().is_none_or(|time| *time == late[node]));
            }
        }
    }

    #[test]
    fn incremental_add_refuses_exactly_contradictions(network in networks()) {
        let mut grown = ConsistentNetwork::new();
        for _ in network.nodes() {
            grown.add_node();
        }
        for constraint in network.constraints() {
            let before = grown.network().clone();
            let mut all = before.clone();
            let number = all.add(constraint.clone());
            let consistent = oracle::all_distances(&all).is_some();
            match grown.add(constraint.clone()) {
                Ok(id) => {
                    prop_assert!(consistent);
                    prop_assert_eq!(id, number);
                    prop_assert_eq!(grown.network(), &all);
                }
                Err(cycle) => {
                    prop_assert!(!consistent);
                    prop_assert_eq!(cycle.constraints[0], number);
                    prop_assert!(cycle.holds_in(&all));
                    prop_assert_eq!(grown.network(), &before);
                }
            }
            prop_assert!(grown.schedule().holds_in(grown.network()));
        }
    }

    #[test]
    fn undo_restores_network(
        (base, _) in consistent_networks(),
        additions in networks(),
        extra_nodes in 0..3_usize,
    ) {
        let mut network = ConsistentNetwork::try_from(base.clone()).expect("consistent");
        network.record_times();
        let times = network.schedule().clone();
        let before = network.checkpoint();
        for _ in 0..extra_nodes {
            network.add_node();
        }
        let limit = u32::try_from(network.network().node_count()).expect("small");
        for (place, constraint) in additions.constraints().iter().enumerate() {
            let mut constraint = constraint.clone();
            constraint.from.0 %= limit;
            constraint.to.0 %= limit;
            let inner = network.checkpoint();
            let snapshot = network.network().clone();
            let accepted = network.add(constraint).is_ok();
            if accepted && place % 2 == 0 {
                network.undo_to(inner);
                prop_assert_eq!(network.network(), &snapshot);
            }
            prop_assert!(network.schedule().holds_in(network.network()));
        }
        // Shifts all times a little, which no constraint forbids.
        let later: Vec<_> = network.network().nodes().collect();
        let later = later.into_iter().map(|node| (node, &network.schedule()[node] + &Rational::ONE));
        let later: Vec<_> = later.collect();
        network.reschedule(later);
        network.restore(before);
        prop_assert_eq!(network.network(), &base);
        prop_assert_eq!(network.schedule(), &times);
        prop_assert!(network.schedule().holds_in(network.network()));
        agrees_with_the_oracle(network.network())?;
    }

    #[test]
    fn without_the_implied_constraints_all_distances_stay(
        (network, _) in consistent_networks(),
        kept in prop::collection::vec(any::<bool>(), 50),
        keeps_some in any::<bool>(),
    ) {
        let keep = |id: ConstraintId| keeps_some && kept[id.index()];
        check_implied_is_minimal(&network, keep)?;
    }

    #[test]
    fn implied_constraints_are_found_among_strict_ones_too(
        (network, _) in consistent_strict_networks(),
    ) {
        check_implied_is_minimal(&network, |_| false)?;
    }

    #[test]
    fn implied_constraints_are_found_in_any_consistent_network(network in networks()) {
        if network.consistency().is_ok() {
            check_implied_is_minimal(&network, |_| false)?;
        }
    }
}

/// Checks the verdict, the cycle and the all-pairs distances.
fn agrees_with_the_oracle<W: Weight>(network: &Network<W>) -> TestCaseResult {
    match (
        ConsistentNetwork::try_from(network.clone()),
        oracle::all_distances(network),
    ) {
        (Ok(consistent), Some(expected)) => {
            prop_assert!(consistent.schedule().holds_in(network));
            let minimal = consistent.minimal();
            for from in network.nodes() {
                let to_root = consistent.shortest_paths_to(from);
                for to in network.nodes() {
                    let distance = expected[from.index()][to.index()].as_ref();
                    prop_assert_eq!(minimal.distance(from, to), distance);
                    let single = consistent.distance(from, to);
                    prop_assert_eq!(single.as_ref(), distance);
                    let back = expected[to.index()][from.index()].as_ref();
                    prop_assert_eq!(to_root.distance(to), back);
                }
            }
        }
        (Err(cycle), None) => prop_assert!(cycle.holds_in(network)),
        (Ok(_), None) => prop_assert!(false, "an inconsistent network passed as consistent"),
        (Err(_), Some(_)) => prop_assert!(false, "a consistent network passed as inconsistent"),
    }
    Ok(())
}

/// Checks that a path, if there is a distance, leads from one end to the other and adds up to it.
fn leads(
    network: &ConsistentNetwork,
    path: Option<&[ConstraintId]>,
    (begin, end): (elbowroom_stn::NodeId, elbowroom_stn::NodeId),
    distance: Option<&Rational>,
) -> TestCaseResult {
    prop_assert_eq!(path.is_some(), distance.is_some());
    let mut place = begin;
    let mut sum = Rational::ZERO;
    for id in path.into_iter().flatten() {
        let Constraint { from, to, bound } = network.network().constraint(*id);
        prop_assert_eq!(place, *from);
        place = *to;
        sum += bound;
    }
    if let Some(distance) = distance {
        prop_assert_eq!(place, end);
        prop_assert_eq!(&sum, distance);
    }
    Ok(())
}

/// Checks that the constraints of `implied` can be removed, and that of the others only those of
/// `keep` could be removed as well.
fn check_implied_is_minimal<W: Weight>(
    network: &Network<W>,
    keep: impl Fn(ConstraintId) -> bool,
) -> TestCaseResult {
    let consistent = ConsistentNetwork::try_from(network.clone()).expect("consistent");
    let implied = consistent.implied(&keep);
    prop_assert!(implied.is_sorted());
    // The result does not depend on the schedule.
    for root in network.nodes() {
        for schedule in [
            consistent.earliest_schedule(root),
            consistent.latest_schedule(root),
        ] {
            prop_assert_eq!(&implied, &consistent.implied_seen_from(&schedule, &keep));
        }
    }
    prop_assert!(!implied.iter().any(|&id| keep(id)));
    let rest = network.without(&implied);
    let distances = oracle::all_distances(network);
    prop_assert_eq!(&distances, &oracle::all_distances(&rest));
    for id in network.constraint_ids() {
        if implied.contains(&id) || keep(id) {
            continue;
        }
        let mut more = implied.clone();
        more.push(id);
        more.sort();
        prop_assert_ne!(&distances, &oracle::all_distances(&network.without(&more)));
    }
    Ok(())
}
