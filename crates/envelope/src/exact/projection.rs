//! Two parameters of a region: a slice, or its projection on their plane.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::ParameterId;

use super::polyhedron::{Halfspace, Polyhedron};
use super::{ExactError, Piece, Region, RegionRow};

/// A convex set of values of two parameters.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Polygon {
    /// `factors[0] · x + factors[1] · y <= bound`, or `<` when strict.
    pub rows: Vec<PolygonRow>,
}

/// One side of a [`Polygon`]: the factors of both parameters, the bound of the sum, and `true` if the
/// bound itself is excluded.
type PolygonRow = ([Rational; 2], Rational, bool);

/// A point of the plane.
pub(super) type Point = [Rational; 2];

impl Region {
    /// Returns the slice for some values of the other parameters: the possible values of both
    /// parameters. Pieces that do not intersect the slice are left out.
    pub fn slice(
        &self,
        axes: [ParameterId; 2],
        values: &dyn Fn(ParameterId) -> Rational,
    ) -> Vec<Polygon> {
        let cut = |piece: &Piece| piece.slice(axes, values);
        self.pieces.iter().filter_map(cut).collect()
    }

    /// Returns the projection: the values of both parameters that are possible with some values of
    /// the others. The parts may overlap.
    ///
    /// # Errors
    /// If `flow` breaks, or if there are too many inequalities.
    pub fn projection(
        &self,
        axes: [ParameterId; 2],
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<Polygon>, ExactError> {
        let mut shadows = Vec::new();
        for piece in &self.pieces {
            shadows.push(piece.projection(axes, flow)?);
        }
        Ok(shadows)
    }
}

impl Piece {
    fn slice(
        &self,
        axes: [ParameterId; 2],
        values: &dyn Fn(ParameterId) -> Rational,
    ) -> Option<Polygon> {
        let mut flat = Polygon::default();
        for row in &self.rows {
            let mut bound = row.bound.clone();
            let mut factors = [Rational::ZERO, Rational::ZERO];
            for (id, factor) in &row.factors {
                match axes.iter().position(|axis| axis == id) {
                    Some(place) => factors[place] = factor.clone(),
                    None => bound -= factor * &values(*id),
                }
            }
            if factors.iter().all(Rational::is_zero) {
                if bound.is_negative() || (bound.is_zero() && row.is_strict) {
                    return None;
                }
            } else {
                flat.rows.push((factors, bound, row.is_strict));
            }
        }
        Some(flat)
    }

    fn projection(
        &self,
        axes: [ParameterId; 2],
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Polygon, ExactError> {
        let last = |row: &RegionRow| row.factors.keys().next_back().copied();
        let ids = self.rows.iter().filter_map(last).chain(axes);
        // The axes come after all other coordinates, which are eliminated.
        let others = ids.map(ParameterId::index).max().unwrap_or(0) + 1;
        let place = |id: ParameterId| match axes.iter().position(|axis| *axis == id) {
            Some(place) => others + place,
            None => id.index(),
        };
        let mut polyhedron = Polyhedron::default();
        for row in &self.rows {
            let factors = row.factors.iter();
            polyhedron.push(Halfspace {
                factors: factors
                    .map(|(id, factor)| (place(*id), factor.clone()))
                    .collect(),
                bound: row.bound.clone(),
                is_strict: row.is_strict,
                sources: row.sources.clone(),
            });
        }
        let mut shadow = polyhedron.without(others, flow)?;
        shadow.reduce(flow)?;
        let factor = |factors: &BTreeMap<usize, Rational>, axis: usize| {
            factors.get(&(others + axis)).cloned().unwrap_or_default()
        };
        let rows = shadow.rows().iter().map(|row| {
            let factors = [factor(&row.factors, 0), factor(&row.factors, 1)];
            (factors, row.bound.clone(), row.is_strict)
        });
        Ok(Polygon {
            rows: rows.collect(),
        })
    }
}

impl Polygon {
    /// Returns `true` if a point belongs to it.
    pub fn contains(&self, point: &[Rational; 2]) -> bool {
        self.rows.iter().all(|(factors, bound, is_strict)| {
            let sum = &factors[0] * &point[0] + &factors[1] * &point[1];
            sum < *bound || (sum == *bound && !is_strict)
        })
    }

    /// Returns the corners of the part inside a window `[lower, upper]`, in circular order; empty
    /// if there is none. Sides that do not belong to the part are drawn as if they did.
    pub fn polygon(&self, lower: &[Rational; 2], upper: &[Rational; 2]) -> Vec<[Rational; 2]> {
        let corner = |x: &Rational, y: &Rational| [x.clone(), y.clone()];
        let mut corners = vec![
            corner(&lower[0], &lower[1]),
            corner(&upper[0], &lower[1]),
            corner(&upper[0], &upper[1]),
            corner(&lower[0], &upper[1]),
        ];
        for (factors, bound, _) in &self.rows {
            corners = clipped(&corners, factors, bound);
        }
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        corners
    }
}

/// Returns the part of a convex polygon on one side of a line (Sutherland & Hodgman).
fn clipped(corners: &[Point], factors: &Point, bound: &Rational) -> Vec<Point> {
    let excess = |point: &Point| &factors[0] * &point[0] + &factors[1] * &point[1] - bound;
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (index, end) in corners.iter().enumerate() {
        let start = &corners[(index + corners.len() - 1) % corners.len()];
        let (before, after) = (excess(start), excess(end));
        let crosses = before.is_positive() != after.is_positive();
        if crosses && !before.is_zero() && !after.is_zero() {
            // One is positive and the other is not, so that they differ.
            let share = before.checked_div(&(&before - &after)).unwrap_or_default();
            let along = |axis: usize| &start[axis] + (&end[axis] - &start[axis]) * &share;
            kept.push([along(0), along(1)]);
        }
        if !after.is_positive() {
            kept.push(end.clone());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: i64) -> Rational {
        Rational::from(value)
    }

    /// Returns the region `x + y <= 10`, `2 x - y < 4`, `z <= x`.
    fn region() -> Region {
        let row = |factors: &[(usize, i64)], bound: i64, is_strict| RegionRow {
            factors: factors
                .iter()
                .map(|(index, factor)| (ParameterId::from(*index), number(*factor)))
                .collect(),
            bound: number(bound),
            is_strict,
            sources: [].into(),
        };
        Region {
            pieces: vec![Piece {
                rows: vec![
                    row(&[(0, 1), (1, 1)], 10, false),
                    row(&[(0, 2), (1, -1)], 4, true),
                    row(&[(2, 1), (0, -1)], 0, false),
                ],
            }],
            missing: None,
        }
    }

    #[test]
    fn slice_contains_point_iff_region_does() {
        let region = region();
        let axes = [ParameterId::from(0), ParameterId::from(1)];
        for height in -1..7 {
            let slice = region.slice(axes, &|_| number(height));
            for x in -2..9 {
                for y in -2..12 {
                    let value = |id: ParameterId| number([x, y, height][id.index()]);
                    let inside = slice
                        .iter()
                        .any(|flat| flat.contains(&[number(x), number(y)]));
                    assert_eq!(inside, region.contains(&value), "{x} {y} {height}");
                }
            }
        }
    }

    #[test]
    fn projection_contains_point_iff_region_has_preimage() {
        let region = region();
        let axes = [ParameterId::from(2), ParameterId::from(1)];
        let flow = &mut || ControlFlow::Continue(());
        let shadow = region.projection(axes, flow).expect("few rows");
        for z in -3..9 {
            for y in -3..12 {
                // Halves are fine enough: all bounds are whole numbers, and factors 1 or 2.
                let any = (-20..40).any(|half| {
                    let value = |id: ParameterId| match id.index() {
                        0 => Rational::new(half, 2),
                        1 => number(y),
                        _ => number(z),
                    };
                    region.contains(&value)
                });
                let inside = shadow
                    .iter()
                    .any(|flat| flat.contains(&[number(z), number(y)]));
                assert_eq!(inside, any, "{z} {y}");
            }
        }
    }

    #[test]
    fn polygon_has_corners_of_clipped_region() {
        let flat = &region().slice([ParameterId::from(0), ParameterId::from(1)], &|_| number(0))[0];
        let corners = flat.polygon(&[number(0), number(0)], &[number(8), number(8)]);
        let expected = [[0, 0], [2, 0], [4, 4]]
            .map(|[x, y]| [number(x), number(y)])
            .to_vec();
        for corner in &expected[..2] {
            assert!(corners.contains(corner), "{corners:?}");
        }
        // 2 x - y = 4 and x + y = 10.
        let top = [Rational::new(14, 3), Rational::new(16, 3)];
        assert!(corners.contains(&top), "{corners:?}");
        assert!(corners.contains(&[number(2), number(8)]), "{corners:?}");
        assert_eq!(corners.len(), 5, "{corners:?}");
        let outside = flat.polygon(&[number(20), number(20)], &[number(30), number(30)]);
        assert!(outside.is_empty(), "{outside:?}");
    }
}
