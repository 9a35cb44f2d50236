//! Small networks, and projections of random ones.

use std::sync::Arc;

use proptest::prelude::*;

use super::{Inconsistent, NEVER, Network, NodeId, Within};
use crate::embedded::windows::{Interval, Windows};

#[test]
fn late_end_delays_its_start_and_successors() {
    let mut network = Network::default();
    let start = network.add_node(0, NEVER, &[]).unwrap();
    let follower = network.add_node(0, NEVER, &[(start, 1)]).unwrap();
    let end = network.add_node(50, NEVER, &[(start, 10)]).unwrap();
    network.add_edge(end, start, -10).unwrap();
    assert_eq!(network.earliest(start), 40);
    assert_eq!(network.earliest(follower), 41);
}

#[test]
fn positive_cycle_is_detected() {
    let mut network = Network::default();
    let start = network.add_node(0, NEVER, &[]).unwrap();
    let inside = network.add_node(0, NEVER, &[(start, 11)]).unwrap();
    let end = network
        .add_node(0, NEVER, &[(start, 10), (inside, 0)])
        .unwrap();
    assert_eq!(network.add_edge(end, start, -10), Err(Inconsistent));
}

/// A happening after some of the last ones, and optionally at most some time after one of them.
type Draft = (Vec<(usize, i64)>, Option<(usize, i64)>);

proptest! {
    #[test]
    fn projection_keeps_all_distances(
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
        // The kept nodes by their names in both networks; the latest comes last.
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
fn unpushable_node_is_settled() {
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

/// A node: its predecessors, an optional upper bound, and an optional list of intervals for it, or
/// for an earlier node and it.
type WindowedDraft = (
    Vec<(usize, i64)>,
    Option<(usize, i64)>,
    Option<(bool, Vec<(i64, i64)>)>,
);

fn windowed_drafts() -> impl Strategy<Value = Vec<WindowedDraft>> {
    let list = prop::collection::vec((2..9_i64, 0..7_i64), 1..4);
    let draft = (
        prop::collection::vec((0..4_usize, 0..9_i64), 0..3),
        prop::option::weighted(0.4, (0..4_usize, 2..20_i64)),
        prop::option::weighted(0.6, (any::<bool>(), list)),
    );
    prop::collection::vec(draft, 1..6)
}

/// Returns consecutive intervals with these gaps and lengths.
fn intervals(gaps: &[(i64, i64)]) -> Vec<Interval> {
    let mut time = 0;
    let intervals = gaps.iter().map(|&(gap, length)| {
        let begin = time + gap;
        time = begin + length;
        (begin, time)
    });
    intervals.collect()
}

/// Returns the least times under all edges `(from, to, distance)`, with each node in its bounds.
fn least_times(edges: &[(usize, usize, i64)], bounds: &[(i64, i64)]) -> Option<Vec<i64>> {
    let mut times: Vec<i64> = bounds.iter().map(|bound| bound.0).collect();
    for _ in 0..=times.len() {
        let before = times.clone();
        for &(from, to, distance) in edges {
            times[to] = times[to].max(times[from] + distance);
        }
        if times == before {
            let is_in_time = times
                .iter()
                .zip(bounds)
                .all(|(time, bound)| *time <= bound.1);
            return is_in_time.then_some(times);
        }
    }
    None
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn windows_give_earliest_times_over_all_interval_choices(drafts in windowed_drafts()) {
        let mut windows = Windows::default();
        let lists: Vec<Option<u32>> = drafts
            .iter()
            .map(|draft| Some(windows.number(intervals(&draft.2.as_ref()?.1))))
            .collect();
        let windows = Arc::new(windows);
        let mut network = Network::with_windows(Some(Arc::clone(&windows)));
        let mut edges: Vec<(usize, usize, i64)> = Vec::new();
        let mut within: Vec<(u32, usize, usize)> = Vec::new();
        let mut result = Ok(());
        for (node, (draft, list)) in drafts.iter().zip(lists).enumerate() {
            let id = |place: usize| NodeId::try_from(place).unwrap();
            let earlier = |back: usize| node.checked_sub(1 + back);
            let after: Vec<_> = draft.0.iter()
                .filter_map(|&(back, distance)| Some((earlier(back)?, distance)))
                .collect();
            edges.extend(after.iter().map(|&(from, distance)| (from, node, distance)));
            let after: Vec<_> = after.iter().map(|&(from, d)| (id(from), d)).collect();
            let added = network.add_node(0, 100, &after);
            prop_assert_eq!(added, Ok(id(node)));
            if let Some((before, most)) = draft.1.and_then(|(b, most)| Some((earlier(b)?, most))) {
                edges.push((node, before, -most));
                result = network.add_edge(id(node), id(before), -most);
            }
            if let (Ok(()), Some(list), Some((is_pair, _))) = (result, list, &draft.2) {
                let paired = earlier(0).filter(|&first| {
                    *is_pair && edges.iter().any(|edge| (edge.0, edge.1) == (first, node))
                });
                let first = paired.unwrap_or(node);
                within.push((list, first, node));
                let (first, last) = (id(first), id(node));
                result = network.keep_within(Within { windows: list, tail: 0, first, last });
            }
            if result.is_err() {
                break;
            }
        }
        let count = network.node_count();
        let mut least: Option<Vec<i64>> = None;
        let sizes: Vec<usize> = within.iter().map(|w| windows.list(w.0).len()).collect();
        for choice in 0..sizes.iter().product::<usize>() {
            let mut bounds = vec![(0, 100); count];
            let mut rest = choice;
            for (&(list, first, last), &size) in within.iter().zip(&sizes) {
                let (begin, end) = windows.list(list)[rest % size];
                rest /= size;
                bounds[first].0 = bounds[first].0.max(begin);
                bounds[last].1 = bounds[last].1.min(end);
            }
            if let Some(times) = least_times(&edges, &bounds) {
                least = Some(match least {
                    None => times,
                    Some(least) => least.into_iter().zip(times).map(|(a, b)| a.min(b)).collect(),
                });
            }
        }
        let ours = result.ok().map(|()| {
            (0..count)
                .map(|node| network.earliest(NodeId::try_from(node).unwrap()))
                .collect::<Vec<_>>()
        });
        prop_assert_eq!(ours, least);
    }
}
