//! Incremental checks after one link has changed, compared with checks from scratch.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "the helpers of a test are part of it, and the game has some for other tests"
)]

use crate::game::{Board, Random};
use crate::plan_networks::rows;
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, Recheck, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, Weight};

/// Changes links at random, one at a time; counts refusals and acceptances.
fn change(network: UncertainNetwork<i64>, random: &mut Random, counts: &mut [usize; 2]) {
    let Ok(mut check) = Recheck::new(network) else {
        return;
    };
    if check.network().links().is_empty() {
        return;
    }
    for _ in 0..12 {
        let ids: Vec<_> = check.network().link_ids().collect();
        let id = ids[random.below(ids.len())];
        let lower = random.whole(0, 8);
        let upper = (random.below(8) > 0).then(|| lower + random.whole(0, 12));
        let before = check.network().clone();
        let mut links = before.links().to_vec();
        (links[id.index()].lower, links[id.index()].upper) = (lower, upper);
        let changed = UncertainNetwork::new(before.requirements().clone(), links).unwrap();
        let expected = changed.is_dynamically_controllable();
        match check.change(id, lower, upper) {
            Ok(()) => {
                assert!(expected, "{changed:?}");
                assert_eq!(*check.network(), changed);
                counts[0] += 1;
            }
            Err(conflict) => {
                assert!(!expected, "{changed:?}");
                assert_eq!(*check.network(), before);
                assert!(conflict.total < Weight::zero() && conflict.is_whole);
                let sum = conflict
                    .steps
                    .iter()
                    .fold(Weight::zero(), |sum, step| Weight::plus(&sum, &step.bound));
                assert_eq!(conflict.total, sum);
                counts[1] += 1;
            }
        }
    }
}

#[test]
fn recheck_equals_check_from_scratch() {
    let mut counts = [0; 2];
    for seed in 0..4_000 {
        let mut random = Random(seed);
        change(
            Board::random(&mut random).network(),
            &mut random,
            &mut counts,
        );
        change(rows(&mut random), &mut random, &mut counts);
    }
    assert!(counts.iter().all(|&count| count > 5_000), "{counts:?}");
}

/// The same network in other units gives the same results, with and without whole numbers.
#[test]
fn integer_weights_give_same_result() {
    let mut controllable = 0;
    for seed in 0..2_000 {
        let network = rows(&mut Random(seed));
        let seventh = |number: i64| Rational::new(number, 7);
        let mut requirements = Network::with_nodes(network.requirements().node_count());
        for constraint in network.requirements().constraints() {
            requirements.add(Constraint {
                from: constraint.from,
                to: constraint.to,
                bound: seventh(constraint.bound),
            });
        }
        let links = network.links().iter().map(|link| ContingentLink {
            activation: link.activation,
            end: link.end,
            lower: seventh(link.lower),
            upper: link.upper.map(seventh),
        });
        let fractions = UncertainNetwork::new(requirements, links.collect()).unwrap();
        let conflict = fractions.dispatchable().err();
        assert_eq!(
            fractions.check_controllability().err(),
            conflict,
            "seed {seed}"
        );
        let whole = fractions.clone().into_executable();
        for (one, other) in [
            (fractions.dynamic(), fractions.dispatchable()),
            (
                fractions.executable(),
                whole.map_err(|(_, conflict)| conflict),
            ),
        ] {
            match (one, other) {
                (Ok(one), Ok(other)) => {
                    assert!(one.edges().eq(other.edges()), "seed {seed}");
                    assert!(one.waits().eq(other.waits()), "seed {seed}");
                    controllable += 1;
                }
                (one, other) => assert_eq!(one.err(), other.err(), "seed {seed}"),
            }
        }
    }
    assert!((400..3_600).contains(&controllable), "{controllable}");
}
