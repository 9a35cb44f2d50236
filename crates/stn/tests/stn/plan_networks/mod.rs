//! Networks similar to those of plans.

use elbowroom_stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId};

use crate::game::Random;

/// Returns jobs in rows: each action is a link, starts wait for ends of the same row and sometimes
/// of another one, some rows have deadlines, and some differences are bounded above.
pub(crate) fn rows(random: &mut Random) -> UncertainNetwork<i64> {
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
