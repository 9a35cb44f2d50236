//! A dispatcher's verdict on the remaining network when links violate their bounds, compared with a
//! check of the whole remaining network from scratch.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "the helpers of a test are part of it, and the game has some for other tests"
)]

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::game::{Board, Random};
use crate::plan_networks::rows;
use elbowroom_stn::uncertain::{ContingentLink, Dispatcher, LinkId, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId};

/// Returns the number in the environment variable, for longer manual runs, or the default.
fn many(default: u64) -> u64 {
    std::env::var("ELBOWROOM_NETWORKS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(default)
}

/// Running execution of a network in a world that does not keep to the bounds of its links.
struct Run {
    network: UncertainNetwork<i64>,
    dispatcher: Dispatcher<i64>,
    now: i64,
    /// Prolonged links, with their latest ends.
    prolonged: BTreeMap<LinkId, Option<i64>>,
}

/// Numbers of remaining networks that were and were not executable, after an end outside its bounds
/// and for an overdue end.
#[derive(Debug, Default)]
struct Counts {
    ended: [usize; 2],
    overdue: [usize; 2],
    /// Number of overdue links that could not be prolonged, and of those that could be prolonged
    /// until some time, which was not always the requested one.
    furthest: [usize; 2],
    shortened: usize,
    /// Number of networks that only the check from scratch found executable.
    late: usize,
    finished: usize,
}

impl Run {
    /// Returns `true` if the remaining network is dynamically controllable, by a check from
    /// scratch.
    fn is_sure(&self) -> bool {
        let happened = |node: NodeId| self.dispatcher.event_time(node).copied();
        let requirements = self.network.requirements();
        let mut rest = Network::with_nodes(requirements.node_count());
        for constraint in requirements.constraints() {
            match (happened(constraint.from), happened(constraint.to)) {
                (Some(from), Some(to)) if to - from > constraint.bound => return false,
                (Some(_), Some(_)) => {}
                _ => {
                    rest.add(constraint.clone());
                }
            }
        }
        for node in requirements.nodes().skip(1) {
            if let Some(time) = happened(node) {
                rest.add(Constraint::at_least(NodeId(0), node, time));
                rest.add(Constraint::at_most(NodeId(0), node, time));
            } else if !self.network.is_contingent(node) {
                rest.add(Constraint::at_least(NodeId(0), node, self.now));
            }
        }
        let mut links = Vec::new();
        for id in self.network.link_ids() {
            let link = self.network.link(id);
            let mut link = link.clone();
            if happened(link.end).is_some() {
                continue;
            }
            if let Some(begun) = happened(link.activation) {
                link.lower = link.lower.max(self.now - begun);
                if let Some(until) = self.prolonged.get(&id) {
                    link.upper = until.map(|until| until - begun);
                }
            }
            links.push(link);
        }
        UncertainNetwork::new(rest, links)
            .unwrap()
            .is_dynamically_controllable()
    }

    /// Returns the running links, with their start times.
    fn active(&self) -> Vec<(LinkId, ContingentLink<i64>, i64)> {
        let links = self.network.link_ids().filter_map(|id| {
            let link = self.network.link(id);
            let begun = *self.dispatcher.event_time(link.activation)?;
            let is_over = self.dispatcher.event_time(link.end).is_some();
            (!is_over).then(|| (id, link.clone(), begun))
        });
        links.collect()
    }

    /// Returns `true` if the current time is within the bounds of a link, or within its prolonged
    /// ones.
    fn is_within(&self, id: LinkId, link: &ContingentLink<i64>, begun: i64) -> bool {
        let last = match self.prolonged.get(&id) {
            Some(until) => *until,
            None => link.upper.map(|upper| begun + upper),
        };
        link.lower <= self.now - begun && last.is_none_or(|last| self.now <= last)
    }

    /// Lets the world end some links. Returns `None` when the remaining network is no longer
    /// executable.
    fn world(&mut self, random: &mut Random, counts: &mut Counts, told: &str) -> Option<()> {
        loop {
            let mut ending = self.active();
            ending.retain(|(id, link, begun)| {
                let is_within = self.is_within(*id, link, *begun);
                random.below(if is_within { 3 } else { 12 }) == 0
            });
            let Some((id, link, begun)) = ending.first() else {
                return Some(());
            };
            let is_within = self.is_within(*id, link, *begun);
            let missed = self.dispatcher.record(link.end, &self.now).err();
            self.prolonged.remove(id);
            assert_eq!(missed.is_none(), is_within, "{told}: {missed:?}");
            let Some(missed) = missed else {
                continue;
            };
            let bears =
                missed.is_only_link && self.dispatcher.stays_executable(link.end, &self.now);
            self.compare(bears, &mut counts.ended, &mut counts.late, told)?;
        }
    }

    /// Checks that `prolongable` returns the latest time that `prolong` accepts.
    fn furthest(&self, id: LinkId, most: i64, counts: &mut Counts, told: &str) {
        let does = |until: i64| {
            let mut other = self.dispatcher.clone();
            other.extend_link(id, Some(&until), &self.now)
        };
        let last = (self.now..=most).rev().find(|until| does(*until));
        let found = self.dispatcher.extendable_until(id, &most, &self.now);
        assert_eq!(found, last, "{told}: until {most} at {}", self.now);
        counts.furthest[usize::from(found.is_some())] += 1;
        counts.shortened += usize::from(found.is_some_and(|found| found < most));
    }

    /// Prolongs each overdue link for ever, or for a while.
    fn overdue(&mut self, random: &mut Random, counts: &mut Counts, told: &str) -> Option<()> {
        for (id, link, begun) in self.active() {
            let is_late = link.lower <= self.now - begun && !self.is_within(id, &link, begun);
            if !is_late {
                continue;
            }
            self.furthest(id, self.now + random.whole(0, 9), counts, told);
            let until = (random.below(2) == 0).then(|| self.now + random.whole(0, 4));
            let does = self.dispatcher.extend_link(id, until.as_ref(), &self.now);
            self.prolonged.insert(id, until);
            let others = self.active();
            let mut others = others.iter().filter(|(other, link, begun)| {
                link.lower <= self.now - begun && !self.is_within(*other, link, *begun)
            });
            if others.next().is_some() {
                // The check from scratch is only comparable after all overdue links have been
                // prolonged.
                if does {
                    continue;
                }
                return None;
            }
            self.compare(does, &mut counts.overdue, &mut counts.late, told)?;
        }
        Some(())
    }

    fn compare(
        &self,
        says: bool,
        counts: &mut [usize; 2],
        late: &mut usize,
        told: &str,
    ) -> Option<()> {
        let is_sure = self.is_sure();
        assert!(!says || is_sure, "{told} at {}", self.now);
        *late += usize::from(is_sure && !says);
        counts[usize::from(says)] += 1;
        says.then_some(())
    }

    /// Executes the network, point by point, as long as it stays executable.
    fn go(&mut self, random: &mut Random, counts: &mut Counts, told: &str) -> Option<()> {
        let trouble = |missed| panic!("{told}: {missed:?}");
        self.dispatcher
            .record(NodeId(0), &0)
            .unwrap_or_else(trouble);
        while self.now < 200 {
            self.overdue(random, counts, told)?;
            self.world(random, counts, told)?;
            let ready: Vec<(i64, Option<i64>, NodeId)> = self
                .dispatcher
                .ready()
                .filter_map(|node| {
                    let earliest = self.dispatcher.earliest(node).ok()?.copied();
                    let latest = self.dispatcher.window(node).1.copied();
                    Some((earliest.unwrap_or(0), latest, node))
                })
                .collect();
            let open = ready.iter().filter(|(earliest, ..)| *earliest <= self.now);
            let deadline = ready.iter().filter_map(|(_, latest, _)| *latest).min();
            let first = open.min_by_key(|(_, latest, node)| (latest.unwrap_or(i64::MAX), *node));
            if let Some(&(_, _, node)) = first
                && (deadline.is_some_and(|deadline| deadline <= self.now) || random.below(3) == 0)
            {
                self.dispatcher
                    .record(node, &self.now)
                    .unwrap_or_else(trouble);
                continue;
            }
            assert!(
                deadline.is_none_or(|deadline| deadline > self.now),
                "{told}: {ready:?}"
            );
            self.now += 1;
        }
        for constraint in self.network.requirements().constraints() {
            let times =
                [constraint.to, constraint.from].map(|node| self.dispatcher.event_time(node));
            if let [Some(to), Some(from)] = times {
                assert!(to - from <= constraint.bound, "{told}");
            }
        }
        let mut nodes = self.network.requirements().nodes();
        assert!(
            nodes.all(|node| self.dispatcher.event_time(node).is_some()),
            "{told}: not all has happened"
        );
        counts.finished += 1;
        Some(())
    }
}

/// Returns the network without constraints from node 0 to others.
fn without_horizon(network: &UncertainNetwork<i64>) -> UncertainNetwork<i64> {
    let mut requirements = Network::with_nodes(network.requirements().node_count());
    for constraint in network.requirements().constraints() {
        if constraint.from != NodeId(0) {
            requirements.add(constraint.clone());
        }
    }
    UncertainNetwork::new(requirements, network.links().to_vec()).unwrap()
}

#[test]
fn executability_is_decided_by_neighbours() {
    let mut counts = Counts::default();
    for seed in 0..many(6_000) {
        let mut random = Random(seed);
        let board = Board::random(&mut random).network();
        let open = without_horizon(&board);
        for (kind, network) in [board, open, rows(&mut random)].into_iter().enumerate() {
            let form = match seed % 4 {
                0 => network.dynamic(),
                _ => network.executable(),
            };
            let Ok(form) = form else {
                continue;
            };
            for run in 0..3 {
                let told = format!("seed {seed}, kind {kind}, run {run}: {network:?}");
                let mut run = Run {
                    network: network.clone(),
                    dispatcher: Dispatcher::new(Arc::new(form.clone())),
                    now: 0,
                    prolonged: BTreeMap::new(),
                };
                run.go(&mut random, &mut counts, &told);
            }
        }
    }
    println!("{counts:?}");
    let furthest = counts.furthest.iter();
    assert!(furthest.copied().all(|count| count > 500), "{counts:?}");
    let cases = counts.ended.iter().chain(&counts.overdue);
    assert!(
        cases
            .chain([&counts.finished, &counts.shortened])
            .all(|&count| count > 1_000),
        "{counts:?}"
    );
}
