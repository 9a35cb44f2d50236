//! Weak controllability, compared with a check of all corners.

use std::collections::BTreeMap;

use elbowroom_network::weak::{StepGround, conflict_with};
use elbowroom_network::{WeakControllability, weak};
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, LinkId, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId};
use proptest::prelude::*;

/// Returns `true` if there is a schedule at each corner; links without an upper bound end very late
/// there.
fn is_weak_by_enumeration(network: &UncertainNetwork<Rational>) -> bool {
    let links: Vec<LinkId> = network.link_ids().collect();
    (0..1_u32 << links.len()).all(|corner| {
        let durations: BTreeMap<LinkId, Rational> = links
            .iter()
            .enumerate()
            .map(|(bit, &id)| {
                let link = network.link(id);
                let far = || &link.lower + Rational::from(1_000_000);
                let upper = link.upper.clone().unwrap_or_else(far);
                let is_lower = corner >> bit & 1 == 0;
                (id, if is_lower { link.lower.clone() } else { upper })
            })
            .collect();
        conflict_with(network, &durations).is_none()
    })
}

fn arbitrary_networks() -> impl Strategy<Value = UncertainNetwork<Rational>> {
    let point = 0..7_u32;
    let edges = prop::collection::vec((point.clone(), point, -6..14_i64), 0..16);
    let link = (0..7_u32, 0..4_i64, prop::option::weighted(0.85, 0..8_i64));
    let links = prop::collection::vec(link, 0..6);
    (edges, links).prop_map(|(edges, links)| {
        let mut requirements = Network::with_nodes(7);
        for (from, to, bound) in edges {
            let bound = Rational::from(bound);
            requirements.add(Constraint::at_most(NodeId(from), NodeId(to), bound));
        }
        // The link that ends at node n begins before n, so that no link depends on itself.
        let contingent = links
            .into_iter()
            .enumerate()
            .map(|(index, (begin, lower, width))| {
                let end = u32::try_from(index).expect("few links") + 1;
                ContingentLink {
                    activation: NodeId(begin % end),
                    end: NodeId(end),
                    lower: Rational::from(lower),
                    upper: width.map(|width| Rational::from(lower + width)),
                }
            });
        UncertainNetwork::new(requirements, contingent.collect()).expect("sound links")
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn branching_agrees_with_corner_enumeration(network in arbitrary_networks()) {
        match weak(&network, 1000) {
            WeakControllability::Controllable => prop_assert!(is_weak_by_enumeration(&network)),
            WeakControllability::Uncontrollable(conflict) => {
                prop_assert!(!is_weak_by_enumeration(&network));
                // The durations lie within the bounds, and the steps form a negative cycle.
                for (&id, duration) in &conflict.durations {
                    let link = network.link(id);
                    prop_assert!(*duration >= link.lower);
                    prop_assert!(link.upper.as_ref().is_none_or(|upper| duration <= upper));
                }
                let total: Rational = conflict.steps.iter().map(|step| &step.bound).sum();
                prop_assert!(total == conflict.total && total.is_negative());
                let nexts = conflict.steps.iter().cycle().skip(1);
                for (step, next) in conflict.steps.iter().zip(nexts) {
                    prop_assert_eq!(step.to, next.from);
                    match step.ground {
                        StepGround::Requirement(id) => {
                            let constraint = network.requirements().constraint(id);
                            prop_assert_eq!(&constraint.bound, &step.bound);
                        }
                        StepGround::Link(id) => {
                            prop_assert_eq!(&conflict.durations[&id], &step.bound.abs());
                        }
                    }
                }
            }
            WeakControllability::Undecided { branches } => prop_assert!(false, "undecided after {branches}"),
        }
    }

    #[test]
    fn dynamic_controllability_implies_weak_controllability(network in arbitrary_networks()) {
        if network.is_dynamically_controllable() {
            prop_assert_eq!(weak(&network, 1000), WeakControllability::Controllable);
        }
    }
}

/// Two links that must end together, whatever their durations, are not weakly controllable. They
/// are if the executor chooses when they begin.
#[test]
fn weak_but_not_dynamic_controllability() {
    let minutes = |n: i64| Rational::from(n);
    let network = |is_together: bool| {
        let mut requirements = Network::with_nodes(4);
        requirements.add(Constraint::at_most(NodeId(1), NodeId(3), minutes(0)));
        requirements.add(Constraint::at_most(NodeId(3), NodeId(1), minutes(0)));
        if is_together {
            requirements.add(Constraint::at_most(NodeId(0), NodeId(2), minutes(0)));
            requirements.add(Constraint::at_most(NodeId(2), NodeId(0), minutes(0)));
        }
        let link = |activation, end| ContingentLink {
            activation: NodeId(activation),
            end: NodeId(end),
            lower: minutes(1),
            upper: Some(minutes(3)),
        };
        UncertainNetwork::new(requirements, vec![link(0, 1), link(2, 3)]).expect("sound")
    };
    assert_eq!(
        weak(&network(false), 100),
        WeakControllability::Controllable
    );
    assert!(!network(false).is_dynamically_controllable());
    let WeakControllability::Uncontrollable(conflict) = weak(&network(true), 100) else {
        panic!("the durations differ");
    };
    assert_eq!(conflict.total, minutes(-2));
}
