//! Refutations hold for all bounds with a negative sum.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "the helpers of a test are part of it, and the game has some for other tests"
)]

use crate::game::{Board, Random};
use elbowroom_stn::uncertain::{
    ContingentLink, Part, Refutation, RefutationPath, Refuted, UncertainNetwork,
};
use elbowroom_stn::{Constraint, Network, NodeId};

/// Returns the length of a path with a network's bounds, and `true` if the path is valid with them:
/// the part after a lower-case edge is negative.
fn length(way: &RefutationPath, network: &UncertainNetwork<i64>) -> (i64, bool) {
    let mut length = 0;
    let mut is_legal = true;
    for part in way.parts.iter().rev() {
        length += match part {
            Part::Requirement(id) => network.requirements().constraint(*id).bound,
            Part::Early(link) => {
                is_legal &= length < 0;
                network.link(*link).lower
            }
            Part::Late(link) => -network.link(*link).upper.unwrap(),
            Part::Path(way) => {
                let (own, own_legal) = self::length(way, network);
                is_legal &= own_legal;
                own
            }
        };
    }
    if let Some(link) = way.unlabelled {
        length = length.max(-network.link(link).lower);
    }
    (length, is_legal)
}

fn refutes(refutation: &Refutation, network: &UncertainNetwork<i64>) -> bool {
    assert!(!refutation.is_flat);
    let lengths = refutation.cycle.iter().map(|way| length(way, network));
    let (total, is_legal) = lengths.fold((0, true), |(sum, all), (own, legal)| {
        (sum + own, all && legal)
    });
    total < 0 && is_legal
}

/// Returns the same requirements, with links of other lengths.
fn changed(network: &UncertainNetwork<i64>, random: &mut Random) -> UncertainNetwork<i64> {
    let links = network.links().iter().map(|link| {
        let lower = (link.lower + random.whole(-2, 2)).max(0);
        let upper = (link.upper.unwrap() + random.whole(-2, 2)).max(lower);
        ContingentLink {
            lower,
            upper: Some(upper),
            ..link.clone()
        }
    });
    UncertainNetwork::new(network.requirements().clone(), links.collect()).unwrap()
}

#[test]
fn network_matching_refutation_is_uncontrollable() {
    let mut random = Random(7);
    let (mut refuted, mut further, mut fits, mut waits) = (0, 0, 0, 0);
    for _ in 0..20_000 {
        let network = Board::random(&mut random).network();
        let refutations = match network.refutations(usize::MAX) {
            Refuted::No => {
                assert!(network.is_dynamically_controllable());
                continue;
            }
            Refuted::Refutations(refutations) => refutations,
            Refuted::TooLong => continue,
        };
        assert!(!network.is_dynamically_controllable());
        let first = Refuted::Refutations(refutations[..1].to_vec());
        assert_eq!(network.refutations(1), first);
        refuted += 1;
        further += refutations.len() - 1;
        for refutation in &refutations {
            assert!(refutes(refutation, &network), "{network:?} {refutation:?}");
            let is_wait = |part: &Part| matches!(part, Part::Path(way) if way.unlabelled.is_some());
            waits += usize::from(
                refutation
                    .cycle
                    .iter()
                    .any(|way| way.parts.iter().any(is_wait)),
            );
            for _ in 0..10 {
                let other = changed(&network, &mut random);
                if refutes(refutation, &other) {
                    fits += 1;
                    assert!(
                        !other.is_dynamically_controllable(),
                        "{network:?} {other:?} {refutation:?}"
                    );
                }
            }
        }
    }
    assert!(
        refuted > 1_000 && further > 1_000 && fits > 1_000 && waits > 30,
        "{refuted} {further} {fits} {waits}"
    );
}

/// Each link may take a little longer than the time until the next one's earliest start, so that
/// the last one ends too late. The derivation is nested as deeply as there are links.
#[test]
fn conflict_along_many_windows_is_flat() {
    let (period, more, room) = (10_000, 1, 2_000);
    let mut requirements = Network::with_nodes(6_001);
    let zero = NodeId(0);
    let mut links = Vec::new();
    for index in 0..3_000 {
        let time = i64::from(index) * period;
        let [activation, end] = [1, 2].map(|place| NodeId(2 * index + place));
        requirements.add(Constraint::at_least(zero, activation, time));
        requirements.add(Constraint::at_most(zero, end, time + period + room));
        if index > 0 {
            requirements.add(Constraint::at_least(NodeId(2 * index), activation, 0));
        }
        links.push(ContingentLink {
            activation,
            end,
            lower: 1,
            upper: Some(period + more),
        });
    }
    let network = UncertainNetwork::new(requirements, links).unwrap();
    let Refuted::Refutations(refutations) = network.refutations(1) else {
        panic!("one is not too long to be told");
    };
    let [refutation] = &refutations[..] else {
        panic!("one was wanted");
    };
    assert!(refutation.is_flat);
    let [way] = &refutation.cycle[..] else {
        panic!("the steps are one way");
    };
    let (total, is_legal) = length(way, &network);
    assert!(total < 0 && is_legal && way.parts.len() > 2_000);
    let is_early = |part: &Part| matches!(part, Part::Early(_));
    assert!(!way.parts.iter().any(is_early));
}
