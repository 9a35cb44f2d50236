//! A closed network, for the dynamic guarantee.
//!
//! Take bounds on differences as *edges* (`to - from <= bound`), and waits as edges from the point
//! that waits to the beginning of the duration, labelled with it. The network, the edges and the
//! waits are checked to be closed: where an edge that is not negative, or the shortest way from a
//! duration's beginning to its end, is followed by a negative edge or a wait, there is an edge (or a
//! wait for the same end) beside the two that is no longer than both. Waits are longer than the
//! duration takes at least, so each has an edge beside it that counts minus that. No two of them lead
//! back to where they begin with a negative sum, and the negative ones alone form no circle.
//!
//! That is enough for dynamic controllability (with reactions at once). By Morris & Muscettola
//! (2005), the network is controllable if applying their reduction rules again and again leads to
//! no negative cycle, all labels disregarded. All that the rules lead to is no shorter than some way
//! in the closed network: such a way can be shortened, pair by pair, until its negative edges come
//! first, and then the rule's own pair is one of those that were checked. (Where a rule takes a label
//! away from what is no longer than the least duration, the edge beside the wait is no longer either,
//! because only negative edges are left before it. The shortest duration followed by the edge beside a wait
//! for its own end adds up to zero, so that nothing is lost by leaving out both.) And a negative cycle
//! of the closed network, shortened in the same way, would leave one pair that leads back with a
//! negative sum, or a circle of negative edges.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::times::limit;
use crate::certificate::Certificate;
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::network::{duration, ended_by};
use crate::sound::Strategy;

/// Checks that the strategy works whatever the values in the box are.
///
/// # Errors
/// The first thing that is missing.
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
    network.has_no_negative_circle()?;
    network.is_closed()
}

/// A duration that the world decides on.
struct Duration {
    from: usize,
    to: usize,
    least: Rational,
}

struct Closed {
    points: usize,
    /// By the positions of their constraints.
    durations: BTreeMap<usize, Duration>,
    /// The least bound of those that lead from a point to another one.
    edges: BTreeMap<(usize, usize), Rational>,
    /// For each point that waits for the end of a duration, how long at most after its beginning;
    /// `None` is without limit.
    waits: BTreeMap<(usize, usize), Option<Rational>>,
}

impl Closed {
    /// The network's own edges and waits.
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
            // An upper bound at its least value, a lower one at its greatest.
            if let Some(most) = limit(&constraint.upper, intervals, false, index)? {
                closed.add(from, to, most);
            }
            if let Some(least) = limit(&constraint.lower, intervals, true, index)? {
                closed.add(to, from, -&least);
            }
        }
        Ok(closed)
    }

    /// Adds an edge; whether it says anything new.
    fn add(&mut self, from: usize, to: usize, bound: Rational) -> bool {
        let known = self.edges.get(&(from, to));
        let is_news = known.is_none_or(|known| bound < *known);
        if is_news {
            self.edges.insert((from, to), bound);
        }
        is_news
    }

    /// Adds a wait; whether it says anything new, and may be longer than the duration.
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

    /// The negative edges that leave each point, the waits among them.
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

    /// That the negative edges form no circle: points that none of them leads to are taken away, as
    /// long as there are any.
    fn has_no_negative_circle(&self) -> Result<(), Flaw> {
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
            Some(point) => Err(Flaw::Circle(point)),
            None => Ok(()),
        }
    }

    /// That there is an edge beside each pair.
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
                    self.has_edge(from, to, &sum).ok_or(Flaw::Open(point))?;
                }
            }
        }
        for ((point, index), delay) in &self.waits {
            for &(from, first, of) in &entering[*point] {
                // The least duration says nothing of what waits for its own end.
                if of != Some(*index) {
                    let delay = delay.as_ref().map(|delay| delay - first);
                    let is_there = self.has_wait(from, *index, delay.as_ref());
                    is_there.ok_or(Flaw::Open(*point))?;
                }
            }
        }
        Ok(())
    }

    /// Whether the difference is known to be at most that. What waits longer for the end of a duration
    /// than that takes at least comes so long after its beginning in any case.
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

    /// Whether a point is known to wait so long for the end of a duration (`None`: without limit), or
    /// in any case.
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
