//! The exact volume of a region.
//!
//! By Lasserre's formula ("An analytical expression and an algorithm for the volume of a convex
//! polyhedron in R^n", JOTA 1983): the volume of `{x : a_i x <= b_i}` in `n` dimensions is the sum
//! over the sides of `b_i / (n |a_ij|)` times the volume of side `i`, whose coordinate `j` is
//! eliminated. Groups of parameters without common inequalities are measured separately.

use std::ops::ControlFlow;

use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, End, Interval, Rational};
use elbowroom_plan::ParameterId;

use super::{Piece, Region, RegionRow};

/// Part of a region inside a box, as products of components with few parameters each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BoundedRegion {
    /// The components of each piece; its volume is the product of theirs.
    pub pieces: Vec<Vec<Component>>,
}

/// A bounded convex set of values of some parameters, connected by inequalities.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Component {
    /// The parameters, in the order of the coordinates.
    pub parameters: Vec<ParameterId>,
    /// `Σ factor · coordinate <= bound`; each coordinate is bounded on both sides.
    pub rows: Vec<(Vec<Rational>, Rational)>,
}

impl Region {
    /// Returns the smallest box around the region, by parameter; infinite if unbounded.
    pub fn extent(&self, parameters: usize) -> Vec<Interval> {
        let mut extent: Vec<Option<Interval>> = vec![None; parameters];
        for piece in &self.pieces {
            let mut program = ParameterRanges::new(piece, parameters);
            for (index, own) in extent.iter_mut().enumerate() {
                let found = program.range_of(index);
                *own = Some(match own.take() {
                    None => found,
                    Some(before) => hull(&before, &found),
                });
            }
        }
        let found = |own: Option<Interval>| own.unwrap_or_else(|| Interval::point(Rational::ZERO));
        extent.into_iter().map(found).collect()
    }

    /// Returns the part of the region inside a frame, `[lower, upper]` of each parameter. The
    /// distinction of open and closed sides does not matter for volumes, and is dropped.
    pub fn body(&self, frame: &[(Rational, Rational)]) -> BoundedRegion {
        let pieces = self.pieces.iter().map(|piece| components(piece, frame));
        BoundedRegion {
            pieces: pieces.collect(),
        }
    }
}

/// Returns the smallest interval around two.
fn hull(one: &Interval, two: &Interval) -> Interval {
    let lower = match (one.lower.value(), two.lower.value()) {
        (Some(a), Some(b)) => End::Closed(a.min(b).clone()),
        _ => End::Infinite,
    };
    let upper = match (one.upper.value(), two.upper.value()) {
        (Some(a), Some(b)) => End::Closed(a.max(b).clone()),
        _ => End::Infinite,
    };
    Interval { lower, upper }
}

/// Linear program for the range of each parameter in a piece.
struct ParameterRanges {
    simplex: Simplex,
    variables: Vec<VariableId>,
}

impl ParameterRanges {
    fn new(piece: &Piece, parameters: usize) -> Self {
        let mut simplex = Simplex::new();
        let variables: Vec<VariableId> = (0..parameters).map(|_| simplex.add_variable()).collect();
        for (tag, row) in piece.rows.iter().enumerate() {
            let terms = row.factors.iter();
            let terms: Vec<(VariableId, Rational)> = terms
                .map(|(id, factor)| (variables[id.index()], factor.clone()))
                .collect();
            let sum = simplex.define(&terms);
            simplex.assert_upper(sum, Delta::from(row.bound.clone()), tag);
        }
        Self { simplex, variables }
    }

    fn range_of(&mut self, index: usize) -> Interval {
        let mut furthest = |sign: i64| {
            let sign = Rational::from(sign);
            let objective = [(self.variables[index], sign.clone())];
            match self.simplex.maximize(&objective) {
                Ok(Optimum::Value(value)) => End::Closed(&value.real * &sign),
                Ok(Optimum::Unbounded) | Err(_) => End::Infinite,
            }
        };
        Interval {
            lower: furthest(-1),
            upper: furthest(1),
        }
    }
}

/// Splits the parameters of a piece into groups without common inequalities.
fn components(piece: &Piece, frame: &[(Rational, Rational)]) -> Vec<Component> {
    let mut group: Vec<usize> = (0..frame.len()).collect();
    for row in &piece.rows {
        let mut own = row.factors.keys().map(|id| group[id.index()]);
        let Some(first) = own.next() else { continue };
        let others: Vec<usize> = own.collect();
        for member in &mut group {
            if others.contains(member) {
                *member = first;
            }
        }
    }
    let mut names = group.clone();
    names.sort_unstable();
    names.dedup();
    let component = |name: usize| {
        let members: Vec<usize> = (0..group.len()).filter(|i| group[*i] == name).collect();
        let unit = |place: usize, sign: i64| {
            let mut factors = vec![Rational::ZERO; members.len()];
            factors[place] = Rational::from(sign);
            factors
        };
        let mut rows = Vec::new();
        for (place, index) in members.iter().enumerate() {
            let (lower, upper) = &frame[*index];
            rows.push((unit(place, -1), -lower));
            rows.push((unit(place, 1), upper.clone()));
        }
        let belongs = |row: &&RegionRow| {
            let first = row.factors.keys().next();
            first.is_some_and(|id| group[id.index()] == name)
        };
        for row in piece.rows.iter().filter(belongs) {
            let factor = |index: &usize| {
                let own = row.factors.get(&ParameterId::from(*index));
                own.cloned().unwrap_or_default()
            };
            rows.push((members.iter().map(factor).collect(), row.bound.clone()));
        }
        Component {
            parameters: members.into_iter().map(ParameterId::from).collect(),
            rows,
        }
    };
    names.into_iter().map(component).collect()
}

impl Component {
    /// Returns the volume; `None` if the recursion visits more than `most` sides, or if `flow`
    /// breaks.
    pub fn volume(
        &self,
        most: usize,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Rational> {
        let mut left = most;
        let mut go_on = || {
            left = left.checked_sub(1)?;
            flow().continue_value()
        };
        volume(self.parameters.len(), self.rows.clone(), &mut go_on)
    }

    /// Returns the center and half the widths of an inner box that is large relative to the frame;
    /// `None` if the component has no interior.
    pub fn inscribed(&self) -> Option<(Vec<Rational>, Vec<Rational>)> {
        let count = self.parameters.len();
        let half = |place: usize| {
            // The first rows are the frame.
            let (lower, upper) = (-&self.rows[2 * place].1, &self.rows[2 * place + 1].1);
            (upper - &lower) * Rational::new(1, 2)
        };
        let widths: Vec<Rational> = (0..count).map(half).collect();
        let mut simplex = Simplex::new();
        let middle: Vec<VariableId> = (0..count).map(|_| simplex.add_variable()).collect();
        let size = simplex.add_variable();
        for (tag, (factors, bound)) in self.rows.iter().enumerate() {
            let mut terms: Vec<(VariableId, Rational)> = Vec::new();
            let mut reach = Rational::ZERO;
            for (place, factor) in factors.iter().enumerate() {
                if !factor.is_zero() {
                    terms.push((middle[place], factor.clone()));
                    reach += factor.abs() * &widths[place];
                }
            }
            terms.push((size, reach));
            let sum = simplex.define(&terms);
            simplex.assert_upper(sum, Delta::from(bound.clone()), tag);
        }
        let objective = [(size, Rational::ONE)];
        let Ok(Optimum::Value(most)) = simplex.maximize(&objective) else {
            return None;
        };
        let most = most.real;
        if !most.is_positive() || widths.iter().any(|width| !width.is_positive()) {
            return None;
        }
        let value = |variable: &VariableId| simplex.value(*variable).real.clone();
        Some((
            middle.iter().map(value).collect(),
            widths.iter().map(|width| width * &most).collect(),
        ))
    }
}

/// Rows over coordinates.
type Rows = Vec<(Vec<Rational>, Rational)>;

fn volume(dimension: usize, rows: Rows, go_on: &mut dyn FnMut() -> Option<()>) -> Option<Rational> {
    go_on()?;
    let Some(rows) = irredundant_rows(dimension, rows) else {
        return Some(Rational::ZERO);
    };
    if dimension == 1 {
        return Some(length(&rows));
    }
    let mut sum = Rational::ZERO;
    for (side, (factors, bound)) in rows.iter().enumerate() {
        if bound.is_zero() {
            continue;
        }
        // Prefers a factor of one or minus one, which keeps numbers short.
        let unit = factors
            .iter()
            .position(|factor| factor.abs() == Rational::ONE);
        let pivot = unit.or_else(|| factors.iter().position(|factor| !factor.is_zero()));
        let Some(pivot) = pivot else { continue };
        let own = substituted(&rows, side, pivot);
        let part = volume(dimension - 1, own, go_on)?;
        let height = bound.checked_div(&factors[pivot].abs()).unwrap_or_default();
        sum += height * part;
    }
    let count = Rational::from(i64::try_from(dimension).unwrap_or(i64::MAX));
    Some(sum.checked_div(&count).unwrap_or_default())
}

/// Returns the other rows on the side where this one is tight, without the coordinate `pivot`.
fn substituted(rows: &Rows, side: usize, pivot: usize) -> Rows {
    let (tight, level) = &rows[side];
    let mut others = Vec::with_capacity(rows.len());
    for (index, (factors, bound)) in rows.iter().enumerate() {
        if index == side {
            continue;
        }
        let share = factors[pivot]
            .checked_div(&tight[pivot])
            .unwrap_or_default();
        let keep = |(place, factor): (usize, &Rational)| {
            (place != pivot).then(|| factor - &tight[place] * &share)
        };
        let kept = factors.iter().enumerate().filter_map(keep).collect();
        others.push((kept, bound - level * &share));
    }
    others
}

/// Returns the rows that the bounds of single coordinates do not imply, each direction once; `None`
/// if nothing satisfies them.
fn irredundant_rows(dimension: usize, rows: Rows) -> Option<Rows> {
    let mut kept: Rows = Vec::with_capacity(rows.len());
    for (mut factors, mut bound) in rows {
        let Some(first) = factors.iter().find(|factor| !factor.is_zero()) else {
            if bound.is_negative() {
                return None;
            }
            continue;
        };
        let scale = first.abs();
        if scale != Rational::ONE {
            for factor in &mut factors {
                *factor = factor.checked_div(&scale).unwrap_or_default();
            }
            bound = bound.checked_div(&scale).unwrap_or_default();
        }
        match kept.iter_mut().find(|own| own.0 == factors) {
            Some(own) if bound < own.1 => own.1 = bound,
            Some(_) => {}
            None => kept.push((factors, bound)),
        }
    }
    // The rows on single coordinates are the sides of a box.
    let mut sides: Vec<[Option<Rational>; 2]> = vec![[None, None]; dimension];
    for (factors, bound) in &kept {
        let mut nonzero = (0..dimension).filter(|place| !factors[*place].is_zero());
        if let (Some(place), None) = (nonzero.next(), nonzero.next()) {
            // The first factor is one or minus one.
            if factors[place].is_positive() {
                sides[place][1] = Some(bound.clone());
            } else {
                sides[place][0] = Some(-bound);
            }
        }
    }
    let mut needed = Vec::with_capacity(kept.len());
    for (factors, bound) in kept {
        let is_single = factors.iter().filter(|factor| !factor.is_zero()).count() == 1;
        let reach = |upwards: bool| {
            let mut sum = Rational::ZERO;
            for (place, factor) in factors.iter().enumerate() {
                if !factor.is_zero() {
                    let side = usize::from(factor.is_positive() == upwards);
                    sum += factor * sides[place][side].as_ref()?;
                }
            }
            Some(sum)
        };
        if reach(false).is_some_and(|least| least > bound) {
            return None;
        }
        if !is_single && reach(true).is_some_and(|most| most <= bound) {
            continue;
        }
        needed.push((factors, bound));
    }
    Some(needed)
}

/// Returns the length of an interval with factors one or minus one; zero if it is empty.
fn length(rows: &Rows) -> Rational {
    let (mut lower, mut upper): (Option<Rational>, Option<Rational>) = (None, None);
    for (factors, bound) in rows {
        if factors[0].is_positive() {
            upper = Some(upper.map_or_else(|| bound.clone(), |own| own.min(bound.clone())));
        } else {
            let least = -bound;
            lower = Some(lower.map_or_else(|| least.clone(), |own| own.max(least.clone())));
        }
    }
    match (lower, upper) {
        (Some(lower), Some(upper)) if lower < upper => upper - lower,
        _ => Rational::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn unlimited() -> impl FnMut() -> ControlFlow<()> {
        || ControlFlow::Continue(())
    }

    fn integers(numbers: &[i64]) -> Vec<Rational> {
        numbers
            .iter()
            .map(|number| Rational::from(*number))
            .collect()
    }

    fn component(dimension: usize, most: i64, rows: &[(&[i64], i64)]) -> Component {
        let mut all = Vec::new();
        for place in 0..dimension {
            let mut unit = vec![0; dimension];
            unit[place] = -1;
            all.push((integers(&unit), Rational::ZERO));
            unit[place] = 1;
            all.push((integers(&unit), Rational::from(most)));
        }
        for (factors, bound) in rows {
            all.push((integers(factors), Rational::from(*bound)));
        }
        Component {
            parameters: (0..dimension).map(ParameterId::from).collect(),
            rows: all,
        }
    }

    #[test]
    fn volumes_of_boxes_and_simplices_are_exact() {
        let on = &mut unlimited();
        let mut volume = |component: Component| component.volume(1_000_000, on).expect("few sides");
        assert_eq!(volume(component(5, 3, &[])), Rational::from(243));
        let ones = [1; 6];
        // x_1 + ... + x_n <= 1: 1 / n!.
        for (dimension, factorial) in [(1, 1), (2, 2), (3, 6), (4, 24), (6, 720)] {
            let simplex = component(dimension, 4, &[(&ones[..dimension], 1)]);
            assert_eq!(volume(simplex), Rational::new(1, factorial), "{dimension}");
        }
        // A cube with a corner cut off, with a redundant row and a duplicate.
        let cut = component(3, 1, &[(&[1, 1, 1], 2), (&[2, 2, 2], 4), (&[1, 1, 0], 5)]);
        assert_eq!(volume(cut), Rational::new(5, 6));
        // Empty, and flat.
        assert_eq!(volume(component(2, 1, &[(&[1, 1], -1)])), Rational::ZERO);
        assert_eq!(
            volume(component(2, 1, &[(&[1, -1], 0), (&[-1, 1], 0)])),
            Rational::ZERO
        );
        assert_eq!(
            component(6, 1, &[(&ones, 3)]).volume(20, &mut unlimited()),
            None
        );
    }

    #[test]
    fn the_inscribed_box_is_inside() {
        let (middle, half) = component(3, 6, &[(&[1, 1, 1], 3)])
            .inscribed()
            .expect("an inside");
        assert_eq!(half, vec![Rational::new(1, 2); 3]);
        let far: Rational = middle.iter().zip(&half).map(|(a, b)| a + b).sum();
        assert!(far <= Rational::from(3));
        assert_eq!(component(2, 1, &[(&[1, 1], 0)]).inscribed(), None);
    }

    proptest! {
        /// The volume of a body is the sum of the volumes of its two parts along a line, and lies
        /// between the counts of the small cubes inside it and around it.
        #[test]
        fn volume_is_additive_and_between_cube_counts(
            rows in prop::collection::vec((prop::array::uniform3(-2_i64..3), -2_i64..9), 0..4),
            cut in (prop::array::uniform3(-2_i64..3), -3_i64..9),
        ) {
            let on = &mut unlimited();
            let given: Vec<(&[i64], i64)> = rows.iter().map(|(f, b)| (&f[..], *b)).collect();
            let whole = component(3, 4, &given).volume(1_000_000, on).expect("few sides");
            let mut one = given.clone();
            one.push((&cut.0, cut.1));
            let negated = cut.0.map(|factor| -factor);
            let mut two = given.clone();
            two.push((&negated, -cut.1));
            let mut part = |rows: &[(&[i64], i64)]| component(3, 4, rows).volume(1_000_000, on);
            let both = part(&one).expect("few sides") + part(&two).expect("few sides");
            // With a cut without coordinates, both parts may be the whole body.
            if cut.0 != [0, 0, 0] || cut.1 != 0 {
                prop_assert_eq!(&whole, &both);
            }
            // Cubes with sides of a half: inside if their furthest corner is.
            let (mut inside, mut touched) = (0, 0);
            for cube in 0..512 {
                let low = [cube % 8, cube / 8 % 8, cube / 64];
                let reach = |upwards: bool| given.iter().map(|(factors, bound)| {
                    let far: i64 = (0..3).map(|axis| {
                        let step = i64::from((factors[axis] > 0) == upwards);
                        factors[axis] * (low[axis] + step)
                    }).sum();
                    far - 2 * bound
                }).max().unwrap_or(-1);
                inside += i64::from(reach(true) <= 0);
                touched += i64::from(reach(false) <= 0);
            }
            prop_assert!(Rational::new(inside, 8) <= whole, "{inside} {whole}");
            prop_assert!(whole <= Rational::new(touched, 8), "{touched} {whole}");
        }
    }
}
