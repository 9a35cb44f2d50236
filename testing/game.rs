//! Dynamic controllability as a game of two players in whole time, enumerated completely.
//!
//! At each time the world first decides which links end, then the executor executes points one
//! after the other. Links that these activate can end at once if they may have duration 0. The
//! executor wins if all points happen by the horizon and every requirement holds.

use std::collections::BTreeMap;

use elbowroom_stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom_stn::{Constraint, Network, NodeId};

/// Network with whole bounds. Node 0 happens at 0, and all other nodes between 0 and the horizon.
pub(crate) struct Board {
    pub(crate) count: usize,
    pub(crate) horizon: i64,
    /// `to - from <= bound`.
    pub(crate) requirements: Vec<(usize, usize, i64)>,
    /// Activation, end, lower, upper.
    pub(crate) links: Vec<(usize, usize, i64, i64)>,
}

impl Board {
    /// Returns the board as a network.
    pub(crate) fn network(&self) -> UncertainNetwork<i64> {
        let mut network = Network::with_nodes(self.count);
        let node = |index: usize| NodeId(u32::try_from(index).unwrap());
        for index in 1..self.count {
            network.add(Constraint::at_least(node(0), node(index), 0));
            network.add(Constraint::at_most(node(0), node(index), self.horizon));
        }
        for &(from, to, bound) in &self.requirements {
            network.add(Constraint::at_most(node(from), node(to), bound));
        }
        let links = self
            .links
            .iter()
            .map(|&(activation, end, lower, upper)| ContingentLink {
                activation: node(activation),
                end: node(end),
                lower,
                upper: Some(upper),
            });
        UncertainNetwork::new(network, links.collect()).unwrap()
    }

    /// Returns `true` if the executor has a strategy that wins whatever the world does.
    pub(crate) fn executor_wins(&self) -> bool {
        let mut times = vec![None; self.count];
        times[0] = Some(0);
        let mut game = Game {
            board: self,
            known: BTreeMap::new(),
        };
        // Links that node 0 activates may end at once.
        let began = game.activated(&times, 0, 0);
        game.world_moves(0, &times, &began)
    }

    /// Generates a random board.
    pub(crate) fn random(random: &mut Random) -> Self {
        let count = 3 + random.below(4);
        let horizon = 4 + i64::try_from(random.below(4)).unwrap();
        let mut links = Vec::new();
        let most_links = 1 + random.below((count - 1) / 2 + 1);
        let mut is_end = vec![false; count];
        for _ in 0..most_links {
            let end = 1 + random.below(count - 1);
            let activation = random.below(count);
            // Activations have smaller numbers than ends, so that links never form a cycle.
            if activation >= end || is_end[end] {
                continue;
            }
            is_end[end] = true;
            let lower = random.whole(0, 3);
            links.push((activation, end, lower, lower + random.whole(0, 4)));
        }
        let requirements = (0..random.below(2 * count))
            .filter_map(|_| {
                let (from, to) = (random.below(count), random.below(count));
                (from != to).then(|| (from, to, random.whole(-3, 5)))
            })
            .collect();
        Self {
            count,
            horizon,
            requirements,
            links,
        }
    }
}

struct Game<'a> {
    board: &'a Board,
    /// For positions at the executor's turn, `true` if it wins.
    known: BTreeMap<(i64, Vec<Option<i64>>), bool>,
}

impl Game<'_> {
    fn is_broken(&self, times: &[Option<i64>]) -> bool {
        let mut requirements = self.board.requirements.iter();
        requirements.any(|&(from, to, bound)| match (times[from], times[to]) {
            (Some(from), Some(to)) => to - from > bound,
            _ => false,
        })
    }

    /// Returns the links that a node has just activated and that may end at once.
    fn activated(&self, times: &[Option<i64>], node: usize, _now: i64) -> Vec<usize> {
        let links = self.board.links.iter().enumerate();
        links
            .filter(|(_, (activation, end, lower, _))| {
                *activation == node && times[*end].is_none() && *lower == 0
            })
            .map(|(index, _)| index)
            .collect()
    }

    /// Returns `true` if the executor wins for every choice of which of these links end now.
    fn world_moves(&mut self, now: i64, times: &[Option<i64>], links: &[usize]) -> bool {
        let Some((&first, rest)) = links.split_first() else {
            return self.executor_moves(now, times);
        };
        let (activation, end, _, upper) = self.board.links[first];
        let begun = times[activation].unwrap();
        let mut ended = times.to_vec();
        ended[end] = Some(now);
        let mut now_active = rest.to_vec();
        now_active.extend(self.activated(&ended, end, now));
        if self.is_broken(&ended) || !self.world_moves(now, &ended, &now_active) {
            return false;
        }
        begun + upper == now || self.world_moves(now, times, rest)
    }

    fn executor_moves(&mut self, now: i64, times: &[Option<i64>]) -> bool {
        if times.iter().all(Option::is_some) {
            return true;
        }
        let key = (now, times.to_vec());
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let wins = self.executor_can_win(now, times);
        self.known.insert(key, wins);
        wins
    }

    fn executor_can_win(&mut self, now: i64, times: &[Option<i64>]) -> bool {
        for node in 0..self.board.count {
            let is_end = self.board.links.iter().any(|&(_, end, _, _)| end == node);
            if times[node].is_some() || is_end {
                continue;
            }
            let mut done = times.to_vec();
            done[node] = Some(now);
            if self.is_broken(&done) {
                continue;
            }
            let began = self.activated(&done, node, now);
            if self.world_moves(now, &done, &began) {
                return true;
            }
        }
        if now >= self.board.horizon {
            return false;
        }
        let active = self.board.links.iter().enumerate();
        let active: Vec<usize> = active
            .filter(|(_, (activation, end, lower, _))| {
                times[*end].is_none()
                    && times[*activation].is_some_and(|begun| begun + lower <= now + 1)
            })
            .map(|(index, _)| index)
            .collect();
        self.world_moves(now + 1, times, &active)
    }
}

/// Generator of random numbers (`SplitMix64`), the same on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    pub(crate) fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.next() % u64::try_from(bound).unwrap()).unwrap()
    }

    pub(crate) fn whole(&mut self, least: i64, most: i64) -> i64 {
        least + i64::try_from(self.below(usize::try_from(most - least + 1).unwrap())).unwrap()
    }
}
