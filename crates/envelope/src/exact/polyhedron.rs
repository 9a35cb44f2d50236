//! Polyhedra as intersections of half-spaces, some of them open: elimination of coordinates,
//! redundancy, difference.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use elbowroom_num::simplex::{Simplex, VariableId};
use elbowroom_num::{Delta, Rational};

use super::{ExactError, RegionSource};

/// Number of half-spaces above which redundant ones are removed during elimination.
const MANY_ROWS: usize = 64;
/// The limit on half-spaces.
const MAX_ROWS: usize = 512;

/// `Σ factor · coordinate <= bound`, or `<` when strict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Halfspace {
    /// None is zero.
    pub(super) factors: BTreeMap<usize, Rational>,
    pub(super) bound: Rational,
    pub(super) is_strict: bool,
    pub(super) sources: BTreeSet<RegionSource>,
}

impl Halfspace {
    /// Returns the complement.
    pub(super) fn negated(&self) -> Self {
        let factors = self.factors.iter();
        Self {
            factors: factors.map(|(index, factor)| (*index, -factor)).collect(),
            bound: -&self.bound,
            is_strict: !self.is_strict,
            sources: self.sources.clone(),
        }
    }

    /// Returns the sum of both, each times a positive factor, so that the coordinate is eliminated.
    fn combined(&self, other: &Self, coordinate: usize) -> Self {
        let (one, two) = (&self.factors[&coordinate], &other.factors[&coordinate]);
        let (one, two) = (two.abs(), one.abs());
        let mut factors = BTreeMap::new();
        for (row, scale) in [(self, &one), (other, &two)] {
            for (&index, factor) in &row.factors {
                *factors.entry(index).or_insert(Rational::ZERO) += factor * scale;
            }
        }
        factors.retain(|_, factor| !factor.is_zero());
        Self {
            factors,
            bound: &self.bound * &one + &other.bound * &two,
            is_strict: self.is_strict || other.is_strict,
            sources: self.sources.union(&other.sources).copied().collect(),
        }
    }

    /// Scales the factors to whole numbers without a common divisor.
    fn normalized(mut self) -> Self {
        let Some(first) = self.factors.values().next() else {
            return self;
        };
        let mut scale = first.abs();
        // The factors become whole numbers when divided by the first and multiplied by the
        // remaining denominators. That takes few steps, because nearly all factors are sums of
        // ones.
        for factor in self.factors.values() {
            let own = factor.checked_div(&scale).unwrap_or_default();
            if let Some(denominator) = own.denominator()
                && denominator > 1
            {
                let smaller = scale.checked_div(&Rational::from(denominator));
                scale = smaller.unwrap_or(scale);
            }
        }
        let Some(scale) = scale.reciprocal() else {
            return self;
        };
        for factor in self.factors.values_mut() {
            *factor = &*factor * &scale;
        }
        self.bound = &self.bound * &scale;
        self
    }

    /// Returns `true` if the half-space lies inside another one with the same factors.
    fn is_tighter(&self, other: &Self) -> bool {
        self.bound < other.bound || (self.bound == other.bound && self.is_strict)
    }
}

/// An intersection of half-spaces.
#[derive(Clone, Debug, Default)]
pub(super) struct Polyhedron {
    rows: Vec<Halfspace>,
    /// For each row, `true` if it is known to be irredundant.
    is_needed: Vec<bool>,
    /// `true` if some row without coordinates cannot hold.
    is_empty: bool,
}

impl Polyhedron {
    pub(super) fn rows(&self) -> &[Halfspace] {
        &self.rows
    }

    pub(super) fn push(&mut self, row: Halfspace) {
        // The new row may make any row redundant.
        self.is_needed.fill(false);
        self.add(row);
    }

    /// Adds a row. The caller guarantees that the rows marked as needed stay needed.
    fn add(&mut self, row: Halfspace) {
        if row.factors.is_empty() {
            self.is_empty |= row.bound.is_negative() || (row.bound.is_zero() && row.is_strict);
            return;
        }
        let row = row.normalized();
        let own = self.rows.iter().position(|own| own.factors == row.factors);
        match own {
            Some(own) if row.is_tighter(&self.rows[own]) => {
                self.rows[own] = row;
                self.is_needed[own] = false;
            }
            Some(_) => {}
            None => {
                self.rows.push(row);
                self.is_needed.push(false);
            }
        }
    }

    pub(super) fn with(&self, row: Halfspace) -> Self {
        let mut polyhedron = self.clone();
        polyhedron.push(row);
        polyhedron
    }

    pub(super) fn retain(&mut self, keep: impl FnMut(&Halfspace) -> bool) {
        let is_kept: Vec<bool> = self.rows.iter().map(keep).collect();
        self.keep(&is_kept);
    }

    fn keep(&mut self, is_kept: &[bool]) {
        let mut kept = is_kept.iter();
        self.rows.retain(|_| kept.next() == Some(&true));
        let mut kept = is_kept.iter();
        self.is_needed.retain(|_| kept.next() == Some(&true));
    }

    /// Returns `true` if the polyhedron is not empty.
    pub(super) fn is_feasible(&self) -> bool {
        !self.is_empty && Program::new(&self.rows).is_feasible(|_| Some(false))
    }

    /// Eliminates the coordinates below `count`.
    pub(super) fn without(
        mut self,
        count: usize,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Self, ExactError> {
        while let Some(coordinate) = self.cheapest(count) {
            if flow().is_break() {
                return Err(ExactError::Stopped);
            }
            self.eliminate(coordinate);
            if self.rows.len() > MANY_ROWS {
                self.reduce(flow)?;
            }
            if self.rows.len() > MAX_ROWS {
                return Err(ExactError::TooManyRows { limit: MAX_ROWS });
            }
        }
        Ok(self)
    }

    /// Returns the coordinate below `count` whose elimination creates the fewest rows.
    fn cheapest(&self, count: usize) -> Option<usize> {
        let mut uses: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
        for row in &self.rows {
            for (&index, factor) in row.factors.range(..count) {
                let (above, below) = uses.entry(index).or_default();
                if factor.is_positive() {
                    *above += 1;
                } else {
                    *below += 1;
                }
            }
        }
        let cost = |(index, (above, below)): (&usize, &(usize, usize))| {
            let made = if self.equality(*index).is_some() {
                above + below
            } else {
                above * below
            };
            (made.saturating_sub(above + below), *index)
        };
        uses.iter().map(cost).min().map(|(_, index)| index)
    }

    /// Returns two rows that together fix a sum with this coordinate: the one from above and the
    /// one from below.
    fn equality(&self, coordinate: usize) -> Option<(usize, usize)> {
        let uses = |row: &Halfspace| row.factors.contains_key(&coordinate) && !row.is_strict;
        self.rows.iter().enumerate().find_map(|(index, row)| {
            if !uses(row) || row.factors[&coordinate].is_negative() {
                return None;
            }
            let opposite = Halfspace {
                is_strict: false,
                ..row.negated()
            };
            let is_other = |own: &Halfspace| {
                !own.is_strict && own.factors == opposite.factors && own.bound == opposite.bound
            };
            Some((index, self.rows.iter().position(is_other)?))
        })
    }

    fn eliminate(&mut self, coordinate: usize) {
        let equality = self.equality(coordinate);
        let rows = std::mem::take(&mut self.rows);
        let was_needed = std::mem::take(&mut self.is_needed);
        let (mut above, mut below) = (Vec::new(), Vec::new());
        for (index, row) in rows.iter().enumerate() {
            match row.factors.get(&coordinate) {
                None => {
                    self.rows.push(row.clone());
                    // A point that violates only this row has a projection that violates only this
                    // row.
                    self.is_needed.push(was_needed[index]);
                }
                Some(factor) if factor.is_positive() => above.push(index),
                Some(_) => below.push(index),
            }
        }
        for &upper in &above {
            for &lower in &below {
                let is_needed = match equality {
                    None => true,
                    // The combinations with one of the two imply the others.
                    Some((up, down)) => (upper == up) != (lower == down),
                };
                if is_needed {
                    self.add(rows[upper].combined(&rows[lower], coordinate));
                }
            }
        }
    }

    /// Drops redundant rows.
    pub(super) fn reduce(
        &mut self,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<(), ExactError> {
        if self.is_empty {
            return Ok(());
        }
        let mut program = Program::new(&self.rows);
        let mut is_kept = vec![true; self.rows.len()];
        // Rows with the most sources first, because the remaining rows are explained by their
        // sources.
        let is_open = |index: &usize| !self.is_needed[*index];
        let mut order: Vec<usize> = (0..self.rows.len()).filter(is_open).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(self.rows[index].sources.len()));
        for candidate in order {
            if flow().is_break() {
                return Err(ExactError::Stopped);
            }
            let needed = program.is_feasible(|index| {
                if index == candidate {
                    Some(true)
                } else {
                    is_kept[index].then_some(false)
                }
            });
            is_kept[candidate] = needed;
        }
        self.keep(&is_kept);
        self.is_needed.fill(true);
        Ok(())
    }

    /// Returns the difference of this polyhedron and another one, in disjoint parts.
    pub(super) fn subtract(self, other: &Self) -> Vec<Self> {
        let mut common = self.clone();
        for row in &other.rows {
            common.push(row.clone());
        }
        if other.is_empty || !common.is_feasible() {
            return vec![self];
        }
        let mut parts = Vec::new();
        let mut rest = self;
        for row in &other.rows {
            let part = rest.with(row.negated());
            if part.is_feasible() {
                parts.push(part);
            }
            rest.push(row.clone());
        }
        parts
    }
}

/// A linear program over the sums of some rows.
struct Program<'a> {
    simplex: Simplex,
    rows: &'a [Halfspace],
    sums: Vec<VariableId>,
}

impl<'a> Program<'a> {
    fn new(rows: &'a [Halfspace]) -> Self {
        let mut simplex = Simplex::new();
        let mut ids: BTreeMap<usize, VariableId> = BTreeMap::new();
        for index in rows.iter().flat_map(|row| row.factors.keys()) {
            ids.entry(*index).or_insert_with(|| simplex.add_variable());
        }
        let mut sums = Vec::new();
        for row in rows {
            let terms = row.factors.iter();
            let terms: Vec<(VariableId, Rational)> = terms
                .map(|(index, factor)| (ids[index], factor.clone()))
                .collect();
            sums.push(simplex.define(&terms));
        }
        Self {
            simplex,
            rows,
            sums,
        }
    }

    /// Returns `true` if there is a point that satisfies the selected rows. `negated` returns
    /// `None` for rows to ignore, and `Some(true)` for rows to negate.
    fn is_feasible(&mut self, negated: impl Fn(usize) -> Option<bool>) -> bool {
        self.simplex.push();
        for (index, (row, sum)) in self.rows.iter().zip(&self.sums).enumerate() {
            let bound = row.bound.clone();
            match negated(index) {
                None => {}
                Some(false) if row.is_strict => {
                    self.simplex
                        .assert_upper(*sum, Delta::just_below(bound), index);
                }
                Some(false) => self.simplex.assert_upper(*sum, Delta::from(bound), index),
                Some(true) if row.is_strict => {
                    self.simplex.assert_lower(*sum, Delta::from(bound), index);
                }
                Some(true) => {
                    self.simplex
                        .assert_lower(*sum, Delta::just_above(bound), index);
                }
            }
        }
        let is_feasible = self.simplex.check().is_ok();
        self.simplex.pop();
        is_feasible
    }
}
