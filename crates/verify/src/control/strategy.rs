//! Closed networks, for the dynamic guarantee.
//!
//! A bound on a difference is an *edge* (`to - from <= bound`). A wait is an edge from the waiting
//! point to the start of the duration, labelled with the duration. The check establishes three
//! properties:
//!
//! - The network, the edges and the waits are closed. Take a first edge that is not negative, or
//!   the edge from a duration's start to its end with the least duration. Follow it by a negative
//!   edge or a wait. Then there is a single edge (or a wait for the same end) from the first to the
//!   last point that is no longer than the two.
//! - No such pair leads back to its first point with a negative sum.
//! - The negative edges alone form no cycle.
//!
//! Waits that are no longer than the least duration are not used. So each wait implies an edge with
//! minus the least duration.
//!
//! These properties are sufficient for dynamic controllability (with immediate reactions). By
//! Morris & Muscettola (2005), the network is controllable if repeated application of their
//! reduction rules leads to no negative cycle, all labels disregarded. Every edge that the rules
//! derive is no shorter than some path in the closed network. Such a path can be shortened, pair by
//! pair, until its negative edges come first; the pair that the rule combines is then one of the
//! checked pairs. (A rule that removes a label from a wait that is no longer than the least
//! duration derives nothing shorter than the edge that the wait implies, because only negative
//! edges remain before it. The least duration followed by the edge implied by a wait for its own
//! end adds up to zero, so both can be omitted.) A negative cycle of the closed network, shortened
//! in the same way, would leave one pair that leads back with a negative sum, or a cycle of
//! negative edges.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::times::limit;
use crate::certificate::Certificate;
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::network::{duration, ended_by};
use crate::sound::Strategy;

/// Checks that the strategy works for all values in the box.
///
/// # Errors
/// The first missing edge or wait.
pub(super) fn check(
    certificate: &Certificate,
    intervals: &Intervals,
    strategy: &Strategy,
) -> Result<(), Flaw> {
    let mut network = Closed::new(certificate, intervals)?;
    for (index, edge) in strategy.edges.iter().enumerate() {
        let points = certificate.points.len();
        let is_there = edge.from < points && edge.to < points;
        if !is_there || !network.add(edge.from, edge.to, edge.most.clone()) {
            return Err(Flaw::Range("edge", index));
        }
    }
    for (index, wait) in strategy.waits.iter().enumerate() {
        let is_there = wait.point < certificate.points.len();
        let delay = wait.delay.as_ref().map(|delay| delay.0.clone());
        if !is_there || !network.wait(wait.point, wait.duration, delay) {
            return Err(Flaw::Range("wait", index));
        }
    }
    network.has_no_negative_cycle()?;
    network.is_closed()
}

/// A duration that the world decides.
struct Duration {
    from: usize,
    to: usize,
    least: Rational,
}

struct Closed {
    points: usize,
    /// Durations, by the position of their constraint.
    durations: BTreeMap<usize, Duration>,
    /// Least bound from one point to another.
    edges: BTreeMap<(usize, usize), Rational>,
    /// For each point that waits for the end of a duration: the longest wait after the duration's
    /// start; `None` is without limit.
    waits: BTreeMap<(usize, usize), Option<Rational>>,
}

impl Closed {
    /// Creates a network with the certificate's own edges and waits.
    fn new(certificate: &Certificate, intervals: &Intervals) -> Result<Self, Flaw> {
        let mut closed = Self {
            points: certificate.points.len(),
            durations: BTreeMap::new(),
            edges: BTreeMap::new(),
            waits: BTreeMap::new(),
        };
        for (point, ended_by) in ended_by(certificate).iter().enumerate().skip(1) {
            if ended_by.is_none() {
                closed.add(point, 0, Rational::ZERO);
            }
        }
        for (index, constraint) in certificate.constraints.iter().enumerate() {
            let (from, to) = (constraint.from, constraint.to);
            if constraint.observed {
                let (least, greatest) = duration(certificate, intervals, index)?;
                if greatest.as_ref() == Some(&least) {
                    closed.add(to, from, -&least);
                }
                closed.durations.insert(index, Duration { from, to, least });
                closed.wait(to, index, greatest);
                continue;
            }
            // An upper bound counts with its least value, a lower bound with its greatest value.
            if let Some(most) = limit(&constraint.upper, intervals, false, index)? {
                closed.add(from, to, most);
            }
            if let Some(least) = limit(&constraint.lower, intervals, true, index)? {
                closed.add(to, from, -&least);
            }
        }
        Ok(closed)
    }

    /// Adds an edge. Returns `true` if it is tighter than the known ones.
    fn add(&mut self, from: usize, to: usize, bound: Rational) -> bool {
        let known = self.edges.get(&(from, to));
        let is_news = known.is_none_or(|known| bound < *known);
        if is_news {
            self.edges.insert((from, to), bound);
        }
        is_news
    }

    /// Adds a wait. Returns `true` if it is longer than the known one and than the least duration.
    fn wait(&mut self, point: usize, duration: usize, delay: Option<Rational>) -> bool {
        let Some(own) = self.durations.get(&duration) else {
            return false;
        };
        let is_longer = delay.as_ref().is_none_or(|delay| *delay > own.least);
        let known = self.waits.get(&(point, duration));
        let is_news = known.is_none_or(|known| match (known, &delay) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(known), Some(delay)) => delay > known,
        });
        if is_longer && is_news {
            self.waits.insert((point, duration), delay);
        }
        is_longer && is_news
    }

    /// Returns the negative edges that leave each point, including the waits.
    fn negative(&self) -> Vec<Vec<usize>> {
        let mut leaving = vec![Vec::new(); self.points];
        for ((from, to), bound) in &self.edges {
            if bound.is_negative() {
                leaving[*from].push(*to);
            }
        }
        for (point, duration) in self.waits.keys() {
            leaving[*point].push(self.durations[duration].from);
        }
        leaving
    }

    /// Checks that the negative edges form no cycle: repeatedly removes points without incoming
    /// negative edges.
    fn has_no_negative_cycle(&self) -> Result<(), Flaw> {
        let leaving = self.negative();
        let mut entering = vec![0_usize; self.points];
        leaving.iter().flatten().for_each(|&to| entering[to] += 1);
        let mut open: Vec<usize> = (0..self.points).filter(|&own| entering[own] == 0).collect();
        let mut taken = 0;
        while let Some(point) = open.pop() {
            taken += 1;
            for &to in &leaving[point] {
                entering[to] -= 1;
                if entering[to] == 0 {
                    open.push(to);
                }
            }
        }
        let left = entering.iter().position(|&count| count > 0);
        match left.filter(|_| taken < self.points) {
            Some(point) => Err(Flaw::NegativeCycle(point)),
            None => Ok(()),
        }
    }

    /// Checks that each pair is implied by a single edge or wait.
    fn is_closed(&self) -> Result<(), Flaw> {
        let mut entering: Vec<Vec<(usize, &Rational, Option<usize>)>> =
            vec![Vec::new(); self.points];
        let mut leaving: Vec<Vec<(usize, &Rational)>> = vec![Vec::new(); self.points];
        for ((from, to), bound) in &self.edges {
            if bound.is_negative() {
                leaving[*from].push((*to, bound));
            } else if from != to {
                entering[*to].push((*from, bound, None));
            }
        }
        for (index, own) in &self.durations {
            entering[own.to].push((own.from, &own.least, Some(*index)));
        }
        for (point, entering) in entering.iter().enumerate() {
            for &(from, first, _) in entering {
                for &(to, second) in &leaving[point] {
                    let sum = first + second;
                    self.has_edge(from, to, &sum)
                        .ok_or(Flaw::NotClosed(point))?;
                }
            }
        }
        for ((point, index), delay) in &self.waits {
            for &(from, first, of) in &entering[*point] {
                // The least duration does not extend a wait for its own end.
                if of != Some(*index) {
                    let delay = delay.as_ref().map(|delay| delay - first);
                    let is_there = self.has_wait(from, *index, delay.as_ref());
                    is_there.ok_or(Flaw::NotClosed(*point))?;
                }
            }
        }
        Ok(())
    }

    /// Returns `Some` if the difference is known to be at most `bound`. A wait implies an edge with
    /// minus the least duration.
    fn has_edge(&self, from: usize, to: usize, bound: &Rational) -> Option<()> {
        if from == to {
            return (!bound.is_negative()).then_some(());
        }
        if self.edges.get(&(from, to)).is_some_and(|own| own <= bound) {
            return Some(());
        }
        let mut waits = self.waits.range((from, 0)..(from + 1, 0));
        let is_there = waits.any(|((_, duration), _)| {
            let own = &self.durations[duration];
            own.from == to && -&own.least <= *bound
        });
        is_there.then_some(())
    }

    /// Returns `Some` if a point is known to wait for at least `delay` for the end of a duration
    /// (`None`: without limit), or comes that late in any case.
    fn has_wait(&self, point: usize, duration: usize, delay: Option<&Rational>) -> Option<()> {
        let begins = self.durations[&duration].from;
        if let Some(delay) = delay
            && self.has_edge(point, begins, &-delay).is_some()
        {
            return Some(());
        }
        if point == begins {
            return None;
        }
        let known = self.waits.get(&(point, duration))?;
        let is_enough = match (known, delay) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(known), Some(delay)) => known >= delay,
        };
        is_enough.then_some(())
    }
}
