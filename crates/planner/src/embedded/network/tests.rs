//! Small networks, and what is kept of random ones.

use proptest::prelude::*;

use super::{Inconsistent, NEVER, Network, NodeId};

#[test]
fn a_late_end_pushes_its_start_and_what_follows_it() {
    let mut network = Network::default();
    let start = network.add_node(0, NEVER, &[]).unwrap();
    let follower = network.add_node(0, NEVER, &[(start, 1)]).unwrap();
    let end = network.add_node(50, NEVER, &[(start, 10)]).unwrap();
    network.add_edge(end, start, -10).unwrap();
    assert_eq!(network.earliest(start), 40);
    assert_eq!(network.earliest(follower), 41);
}

#[test]
fn a_cycle_that_pushes_itself_is_found() {
    let mut network = Network::default();
    let start = network.add_node(0, NEVER, &[]).unwrap();
    let inside = network.add_node(0, NEVER, &[(start, 11)]).unwrap();
    let end = network
        .add_node(0, NEVER, &[(start, 10), (inside, 0)])
        .unwrap();
    assert_eq!(network.add_edge(end, start, -10), Err(Inconsistent));
}

/// A happening after some of the last ones, and perhaps no later than so long after one of them.
type Draft = (Vec<(usize, i64)>, Option<(usize, i64)>);

proptest! {
    #[test]
    fn what_is_projected_keeps_all_distances(
        drafts in prop::collection::vec(
            (
                prop::collection::vec((0..6_usize, 0..9_i64), 0..3),
                prop::option::of((0..6_usize, 9..40_i64)),
            ),
            2..12,
        ),
    ) {
        let drafts: Vec<Draft> = drafts;
        let (mut whole, mut projected) = (Network::default(), Network::default());
        // The nodes that are kept, by their names in both networks; the latest comes last.
        let mut kept: Vec<(NodeId, NodeId)> = Vec::new();
        for (after, before) in drafts {
            let place = |back: usize| kept.len().checked_sub(1 + back);
            let after: Vec<_> = after
                .iter()
                .filter_map(|&(back, distance)| Some((kept[place(back)?], distance)))
                .collect();
            let edges = |name: fn(&(NodeId, NodeId)) -> NodeId| -> Vec<(NodeId, i64)> {
                after.iter().map(|(node, distance)| (name(node), *distance)).collect()
            };
            let new = (
                whole.add_node(0, NEVER, &edges(|node| node.0)).unwrap(),
                projected.add_node(0, NEVER, &edges(|node| node.1)).unwrap(),
            );
            if let Some((old, most)) = before.and_then(|(back, most)| {
                Some((kept[place(back)?], most))
            }) {
                let results = (
                    whole.add_edge(new.0, old.0, -most),
                    projected.add_edge(new.1, old.1, -most),
                );
                prop_assert_eq!(results.0, results.1);
                if results.0.is_err() {
                    return Ok(());
                }
            }
            kept.push(new);
            if kept.len() > 4 {
                kept.remove(0);
            }
            let names = projected.project(&kept.iter().map(|node| node.1).collect::<Vec<_>>());
            for node in &mut kept {
                node.1 = names[node.1 as usize];
            }
            for from in &kept {
                let distances = whole.distances_from(from.0);
                prop_assert_eq!(whole.earliest(from.0), projected.earliest(from.1));
                for to in &kept {
                    let distance = projected.distance(from.1, to.1);
                    prop_assert_eq!(distances[to.0 as usize], distance);
                }
            }
        }
    }
}

#[test]
fn what_nothing_can_push_any_more_is_settled() {
    let mut network = Network::default();
    let first = network.add_node(5, NEVER, &[]).unwrap();
    let second = network.add_node(7, NEVER, &[(first, 1)]).unwrap();
    network.mark(3, first);
    network.mark(4, second);
    let mut settled = Vec::new();
    let names = network.settle([second].into_iter(), &mut |annotation, time| {
        settled.push((annotation, time));
    });
    assert_eq!(settled, [(3, 5)]);
    assert_eq!(names[second as usize], 0);
    assert_eq!(network.marks, [(4, 0)]);
}
