//! Bounds on differences of times in all schedules of a certificate's network.

use std::collections::{BTreeMap, VecDeque};

use elbowroom_num::Rational;

use crate::certificate::{Certificate, Constraint, Limit};
use crate::flaw::Flaw;
use crate::intervals::Intervals;

/// Shortest paths in the network. A parameter counts with the lower end of its interval as a lower bound,
/// and with the upper end as an upper bound.
pub(super) struct Distances {
    /// By point: another point, and the upper bound on the difference of its time.
    edges: Vec<Vec<(usize, Rational)>>,
    /// By point, computed on demand: the upper bound on the difference of each other time; `None`: unbounded.
    known: BTreeMap<usize, Vec<Option<Rational>>>,
}

impl Distances {
    /// Creates the distances of a certificate's network.
    ///
    /// # Errors
    /// When a constraint names a point or a parameter that does not exist.
    pub(super) fn new(certificate: &Certificate, intervals: &Intervals) -> Result<Self, Flaw> {
        let points = certificate.points.len();
        Self::between(points, &certificate.constraints, intervals)
    }

    /// Returns the distances of a network with `points` points.
    ///
    /// # Errors
    /// When a constraint names a point or a parameter that does not exist.
    pub(super) fn between(
        points: usize,
        constraints: &[Constraint],
        intervals: &Intervals,
    ) -> Result<Self, Flaw> {
        let mut edges: Vec<Vec<(usize, Rational)>> = vec![Vec::new(); points];
        for (point, edges) in edges.iter_mut().enumerate().skip(1) {
            debug_assert!(point > 0, "time zero comes first");
            edges.push((0, Rational::ZERO));
        }
        for (index, constraint) in constraints.iter().enumerate() {
            if constraint.from >= points || constraint.to >= points {
                return Err(Flaw::Range("constraint", index));
            }
            let end = |limit: &Limit, side: usize| match limit {
                Limit::None => Ok(None),
                Limit::Number(number) => Ok(Some(number.0.clone())),
                Limit::Parameter(parameter) => Ok(intervals.of(*parameter)?[side].clone()),
            };
            if let Some(least) = end(&constraint.lower, 0)? {
                edges[constraint.to].push((constraint.from, -least));
            }
            if let Some(most) = end(&constraint.upper, 1)? {
                edges[constraint.from].push((constraint.to, most));
            }
        }
        Ok(Self {
            edges,
            known: BTreeMap::new(),
        })
    }

    /// Returns `true` if `later` is at least `least` after `earlier` in every schedule.
    ///
    /// # Errors
    /// When the network has no schedule.
    pub(super) fn is_before(
        &mut self,
        earlier: usize,
        later: usize,
        least: &Rational,
    ) -> Result<bool, Flaw> {
        let own = self.least(earlier, later)?;
        Ok(own.is_some_and(|own| own >= *least))
    }

    /// Returns the least difference of `later` and `earlier` in all schedules, or `None` if it has
    /// no lower limit.
    ///
    /// # Errors
    /// When the network has no schedule.
    pub(super) fn least(&mut self, earlier: usize, later: usize) -> Result<Option<Rational>, Flaw> {
        if !self.known.contains_key(&later) {
            let found = self.from(later)?;
            self.known.insert(later, found);
        }
        Ok(self.known[&later][earlier].as_ref().map(|most| -most))
    }

    /// Returns, for each point, the upper bound on the difference of its time and that of `source`.
    fn from(&self, source: usize) -> Result<Vec<Option<Rational>>, Flaw> {
        let mut most: Vec<Option<Rational>> = vec![None; self.edges.len()];
        most[source] = Some(Rational::ZERO);
        let mut rounds = vec![0_usize; self.edges.len()];
        let mut is_waiting = vec![false; self.edges.len()];
        let mut waiting = VecDeque::from([source]);
        while let Some(point) = waiting.pop_front() {
            is_waiting[point] = false;
            rounds[point] += 1;
            // Without a negative cycle, the number of points limits the improvements of each point.
            if rounds[point] > self.edges.len() {
                return Err(Flaw::NegativeCycle(point));
            }
            let Some(here) = most[point].clone() else {
                continue;
            };
            for (to, weight) in &self.edges[point] {
                let there = &here + weight;
                if most[*to].as_ref().is_none_or(|known| there < *known) {
                    most[*to] = Some(there);
                    if !std::mem::replace(&mut is_waiting[*to], true) {
                        waiting.push_back(*to);
                    }
                }
            }
        }
        Ok(most)
    }
}
