//! A piece of time cut into cells: at the zeros of polynomials, and between them.

use elbowroom_num::Rational;

use super::instant::Instant;
use super::piece::Stretch;
use super::polynomial::{Polynomial, Root};

/// The zeros of some polynomials within a piece.
pub(super) struct Cuts {
    pub(super) polynomials: Vec<Polynomial>,
    /// In order; brackets share no point with each other.
    pub(super) roots: Vec<Root>,
}

/// The polynomial that is zero where one of these is, each zero once.
pub(super) fn product(polynomials: &[Polynomial]) -> Polynomial {
    let one = Polynomial::constant(Rational::ONE);
    polynomials
        .iter()
        .fold(one, |product, polynomial| product.times(polynomial))
        .square_free()
}

/// One cut, or the moments strictly between two neighbouring cuts.
pub(super) struct Cell {
    /// Where to look.
    pub(super) place: Place,
    /// The cut itself, or the one on the left.
    pub(super) from: Root,
    /// Whether these are moments between cuts.
    pub(super) is_open: bool,
    /// Whether the cell reaches the end of the piece.
    pub(super) is_last: bool,
}

/// A position within a piece.
#[derive(Clone)]
pub(super) enum Place {
    Point(Rational),
    Instant(Instant),
    /// At the only zero, of any difference, between these two numbers.
    Root(Rational, Rational),
}

impl Place {
    fn at(root: &Root) -> Self {
        match root {
            Root::Exact(value) => Self::Point(value.clone()),
            Root::Between(low, high) => Self::Root(low.clone(), high.clone()),
        }
    }

    /// The place, or a number close to it.
    pub(super) fn near(&self) -> Rational {
        match self {
            Self::Point(value) | Self::Root(value, _) => value.clone(),
            Self::Instant(at) => at.near(),
        }
    }
}

/// The cells of `[0, length)`, or of `(0, length)`, in order; with a `part`, those of it, whose ends
/// are among the cuts.
pub(super) fn cells(
    cuts: &Cuts,
    length: &Rational,
    part: Option<&Stretch>,
    includes_start: bool,
) -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut left = Root::Exact(Rational::ZERO);
    let mut roots = cuts.roots.as_slice();
    let mut end = Root::Exact(length.clone());
    let mut is_point = false;
    if let Some(part) = part {
        let polynomial = product(&cuts.polynomials);
        // Where the end of the part stands among the cuts; not the ends of the piece.
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
            place: Place::at(&left),
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
        // Brackets share no point with other cuts, so the middle lies strictly between the two,
        // or at the common end of two brackets, which is no zero.
        let middle = (left.upper() + right.lower()) / Rational::from(2);
        cells.push(Cell {
            place: Place::Point(middle),
            from: left,
            is_open: true,
            is_last,
        });
        if !is_last {
            cells.push(Cell {
                place: Place::at(right),
                from: right.clone(),
                is_open: false,
                is_last: false,
            });
        }
        left = right.clone();
    }
    cells
}
