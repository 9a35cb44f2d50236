//! Checking again after one link has changed, against checking from scratch.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "the helpers of a test are part of it, and the game has some for other tests"
)]

mod game;

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, Recheck, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId, Weight};
use game::{Board, Random};

/// Jobs in rows, as plans have them: each action is a link, starts wait for ends of the same row
/// and now and then of another one, some rows have deadlines, some differences are bounded above.
fn plan(random: &mut Random) -> UncertainNetwork<i64> {
    let rows = 1 + random.below(3);
    let length = 1 + random.below(5);
    let mut network = Network::with_nodes(1 + 2 * rows * length);
    let start = |row: usize, at: usize| NodeId(u32::try_from(1 + 2 * (row * length + at)).unwrap());
    let end = |row: usize, at: usize| NodeId(start(row, at).0 + 1);
    let mut links = Vec::new();
    for row in 0..rows {
        for at in 0..length {
            let lower = random.whole(0, 6);
            let upper = (random.below(6) > 0).then(|| lower + random.whole(0, 6));
            links.push(ContingentLink {
                activation: start(row, at),
                end: end(row, at),
                lower,
                upper,
            });
            network.add(Constraint::at_least(NodeId(0), start(row, at), 0));
            if at > 0 {
                let gap = random.whole(0, 2);
                network.add(Constraint::at_least(end(row, at - 1), start(row, at), gap));
            }
            let (other_row, other) = (random.below(rows), random.below(length));
            if (other_row, other) == (row, at) {
                continue;
            }
            match random.below(6) {
                0 => network.add(Constraint::at_most(
                    start(other_row, other),
                    end(row, at),
                    random.whole(0, 30),
                )),
                1 => network.add(Constraint::at_least(
                    start(other_row, other),
                    end(row, at),
                    random.whole(0, 4),
                )),
                2 => network.add(Constraint::at_most(
                    NodeId(0),
                    end(row, at),
                    random.whole(20, 60),
                )),
                _ => continue,
            };
        }
    }
    UncertainNetwork::new(network, links).unwrap()
}

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
fn the_verdict_is_that_of_a_check_from_scratch() {
    let mut counts = [0; 2];
    for seed in 0..4_000 {
        let mut random = Random(seed);
        change(
            Board::random(&mut random).network(),
            &mut random,
            &mut counts,
        );
        change(plan(&mut random), &mut random, &mut counts);
    }
    assert!(counts.iter().all(|&count| count > 5_000), "{counts:?}");
}

/// The same network in other units, by way of whole numbers and without.
#[test]
fn whole_numbers_change_nothing() {
    let mut controllable = 0;
    for seed in 0..2_000 {
        let network = plan(&mut Random(seed));
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
