//! Cells of a piece of time: the zeros of polynomials, and the intervals between them.

use elbowroom_num::Rational;

use super::instant::Instant;
use super::polynomial::{Polynomial, Root};
use super::segment::SegmentPart;

/// Zeros of some polynomials within a piece.
pub(super) struct ZeroSet {
    pub(super) polynomials: Vec<Polynomial>,
    /// Sorted; no two brackets have a common point.
    pub(super) roots: Vec<Root>,
}

/// Returns a polynomial with the zeros of all of these, each zero once.
pub(super) fn product(polynomials: &[Polynomial]) -> Polynomial {
    let one = Polynomial::constant(Rational::ONE);
    polynomials
        .iter()
        .fold(one, |product, polynomial| product.times(polynomial))
        .square_free()
}

/// A cut, or the moments strictly between two neighbouring cuts.
pub(super) struct Cell {
    /// Representative place in the cell.
    pub(super) place: Position,
    /// The cut itself, or the one on the left.
    pub(super) from: Root,
    /// `true` if the cell is the interval between two cuts.
    pub(super) is_open: bool,
    /// `true` if the cell reaches the end of the piece.
    pub(super) is_last: bool,
}

/// A position within a piece.
#[derive(Clone)]
pub(super) enum Position {
    Point(Rational),
    Instant(Instant),
    /// The only zero of any difference between these two numbers.
    Root(Rational, Rational),
}

impl Position {
    fn at(root: &Root) -> Self {
        match root {
            Root::Exact(value) => Self::Point(value.clone()),
            Root::Between(low, high) => Self::Root(low.clone(), high.clone()),
        }
    }

    /// Returns the place, or a number close to it.
    pub(super) fn near(&self) -> Rational {
        match self {
            Self::Point(value) | Self::Root(value, _) => value.clone(),
            Self::Instant(at) => at.near(),
        }
    }
}

/// Returns the cells of `[0, length)`, or of `(0, length)`, in order. With a `part`, returns the
/// cells of the part, whose ends are among the cuts.
pub(super) fn cells(
    cuts: &ZeroSet,
    length: &Rational,
    part: Option<&SegmentPart>,
    includes_start: bool,
) -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut left = Root::Exact(Rational::ZERO);
    let mut roots = cuts.roots.as_slice();
    let mut end = Root::Exact(length.clone());
    let mut is_point = false;
    if let Some(part) = part {
        let polynomial = product(&cuts.polynomials);
        // Position of the part's end among the cuts, without the ends of the piece.
        let find = |roots: &[Root], at: &Instant| {
            let same = |root: &Root| Instant::of(root.clone(), &polynomial) == *at;
            roots.iter().position(same)
        };
        if let Some(position) = find(roots, &part.from) {
            left = roots[position].clone();
            roots = &roots[position + 1..];
        }
        match &part.to {
            None => is_point = true,
            Some(to) => {
                if let Some(position) = find(roots, to) {
                    end = roots[position].clone();
                    roots = &roots[..position];
                }
            }
        }
    }
    if includes_start {
        cells.push(Cell {
            place: Position::at(&left),
            from: left.clone(),
            is_open: false,
            is_last: is_point,
        });
    }
    if is_point {
        return cells;
    }
    for right in roots.iter().chain([&end]) {
        let is_last = *right == end;
        // Brackets have no common points with other cuts. So the middle is strictly between the
        // two, or at the common end of two brackets, which is not a zero.
        let middle = (left.upper() + right.lower()) / Rational::from(2);
        cells.push(Cell {
            place: Position::Point(middle),
            from: left,
            is_open: true,
            is_last,
        });
        if !is_last {
            cells.push(Cell {
                place: Position::at(right),
                from: right.clone(),
                is_open: false,
                is_last: false,
            });
        }
        left = right.clone();
    }
    cells
}
